use std::fs;

use serde::Serialize;

use crate::simd::SimdLevel;

/// What the figures were measured on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// Model of the processor, or its architecture where the system does not say.
    pub cpu: String,
    /// Cores that this process may use.
    pub cores: usize,
    /// Memory in bytes; absent where the system does not say.
    pub memory_bytes: Option<u64>,
    /// The best SIMD level of the processor.
    pub simd: &'static str,
    /// Operating system and its release.
    pub os: String,
}

impl Machine {
    /// This machine.
    pub fn this() -> Self {
        let cpu = field("/proc/cpuinfo", "model name");
        Self {
            cpu: cpu.unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory_bytes: kibibytes("/proc/meminfo", "MemTotal"),
            simd: SimdLevel::best().name(),
            os: os(),
        }
    }
}

fn os() -> String {
    let release = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    format!("{} {}", std::env::consts::OS, release.trim()).trim_end().to_owned()
}

/// The most memory that this process has held at once, in bytes; absent where the system does not say.
pub(super) fn peak_memory() -> Option<u64> {
    kibibytes("/proc/self/status", "VmHWM")
}

/// The memory that this process holds, in bytes; absent where the system does not say.
pub(super) fn held_memory() -> Option<u64> {
    kibibytes("/proc/self/status", "VmRSS")
}

fn kibibytes(file: &str, name: &str) -> Option<u64> {
    let value = field(file, name)?;
    value.strip_suffix(" kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// What stands behind `name:` in a file of such lines.
fn field(file: &str, name: &str) -> Option<String> {
    let text = fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|line| line.split_once(':').filter(|(key, _)| key.trim() == name))?;
    Some(line.1.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_has_a_processor_and_cores() {
        let machine = Machine::this();
        assert!(!machine.cpu.is_empty() && machine.cores > 0 && !machine.os.is_empty());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn held_memory_is_less_than_its_peak_and_the_machine() {
        let (held, peak) = (held_memory().unwrap(), peak_memory().unwrap());
        assert!(held > 0 && held <= peak.max(held) && peak < Machine::this().memory_bytes.unwrap());
    }
}
