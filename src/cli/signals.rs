//! SIGINT and SIGTERM: finish the frame at hand if it is quick, leave whole files only, exit 128 + number.

#[cfg(not(unix))]
use kinora::output::Unfinished;

use super::error::CliError;

/// Notices that a signal asked for the end.
#[derive(Debug)]
pub(crate) struct Signals {
    #[cfg(unix)]
    caught: std::sync::Arc<std::sync::atomic::AtomicI32>,
}

#[cfg(unix)]
mod unix {
    use std::{
        sync::{
            Arc,
            atomic::{AtomicI32, Ordering},
        },
        thread,
        time::Duration,
    };

    use kinora::output::Unfinished;
    use signal_hook::{
        consts::{SIGINT, SIGTERM},
        iterator::Signals as Incoming,
    };

    use super::{CliError, Signals};

    /// How long a frame may go on after the signal; then it is dropped. Schedulers kill after 5 s or more.
    const GRACE: Duration = Duration::from_secs(2);

    impl Signals {
        /// Takes over SIGINT and SIGTERM until the program ends. What `unfinished` lists is removed when a frame
        /// takes too long to wait for, or at the second signal.
        ///
        /// # Errors
        /// When the system gives no handler or thread.
        pub(crate) fn watch(unfinished: &Unfinished) -> Result<Self, CliError> {
            let failed = |e: std::io::Error| CliError::failed(format!("cannot watch for signals: {e}"));
            let mut incoming = Incoming::new([SIGINT, SIGTERM]).map_err(failed)?;
            let caught = Arc::new(AtomicI32::new(0));
            let (seen, unfinished) = (Arc::clone(&caught), unfinished.clone());
            let watch = move || {
                for signal in incoming.forever() {
                    if seen.swap(signal, Ordering::SeqCst) != 0 {
                        end(signal, &unfinished);
                    }
                    let unfinished = unfinished.clone();
                    let late = move || {
                        thread::sleep(GRACE);
                        end(signal, &unfinished);
                    };
                    if thread::Builder::new().spawn(late).is_err() {
                        break;
                    }
                }
            };
            thread::Builder::new().name("kinora-signals".to_owned()).spawn(watch).map_err(failed)?;
            Ok(Self { caught })
        }

        /// Ends with [`CliError::Signal`] when a signal came.
        ///
        /// # Errors
        /// See above.
        pub(crate) fn check(&self) -> Result<(), CliError> {
            match self.caught.load(Ordering::SeqCst) {
                0 => Ok(()),
                number => Err(CliError::Signal(number)),
            }
        }
    }

    fn end(signal: i32, unfinished: &Unfinished) -> ! {
        let _nothing_appears = unfinished.remove_all();
        let error = CliError::Signal(signal);
        eprintln!("kinora: {error}");
        std::process::exit(i32::from(error.exit_code()));
    }
}

#[cfg(not(unix))]
impl Signals {
    /// Other systems end the program themselves.
    pub(crate) fn watch(_unfinished: &Unfinished) -> Result<Self, CliError> {
        Ok(Self {})
    }

    /// Never an error.
    pub(crate) fn check(&self) -> Result<(), CliError> {
        Ok(())
    }
}
