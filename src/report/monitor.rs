use super::ReportError;

/// Hears of progress and may end the work.
pub trait Monitor {
    /// `what` begins now. False ends the report.
    fn goes_on(&mut self, what: &str) -> bool;

    /// As [`Monitor::goes_on`], for use with `?`.
    ///
    /// # Errors
    /// [`ReportError::Stopped`] when the work shall end.
    fn begin(&mut self, what: &str) -> Result<(), ReportError> {
        if self.goes_on(what) { Ok(()) } else { Err(ReportError::Stopped) }
    }
}

/// Says nothing and never ends the work.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet;

impl Monitor for Quiet {
    fn goes_on(&mut self, _what: &str) -> bool {
        true
    }
}
