//! Measurements with tables, plots, stated bounds and comparisons with earlier ones.
//!
//! A [`Report`] holds rows of [`Table`]s, [`Check`]s and [`Plot`]s; [`Report::write`] puts them into a folder as JSON, Markdown and SVG.
//! [`structures`] measures every acceleration structure on scenes and on meshes of growing size; [`frames`] follows the policies of
//! the frame loop; [`papers`] puts the tables of three papers beside ours; [`accuracy`] sets speed against error. [`mod@reference`] holds the right answers that errors are measured by.

pub mod accuracy;
pub mod baseline;
mod check;
pub mod closed;
mod date;
mod error;
pub mod frames;
mod labels;
mod machine;
mod markdown;
pub mod measure;
pub mod meshes;
mod monitor;
pub mod papers;
mod plot;
mod random;
mod rays;
mod record;
pub mod reference;
pub mod structures;
mod subject;
mod table;

use markdown::grouped;

pub use check::{Bound, Check};
pub use error::ReportError;
pub use machine::Machine;
pub use monitor::{Monitor, Quiet};
pub use plot::{Bars, Chart, Dot, Line, Lines, Plot, Scatter, Series};
pub use rays::{RayClass, View};
pub use record::{Kind, Report, SCHEMA, Settings};
pub use subject::Subject;
pub use table::{Cell, Column, Role, Table};
