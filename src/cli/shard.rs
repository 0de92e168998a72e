//! `--shard I/N` and `--shard auto`.

use kinora::output::Shard;

use super::{error::CliError, settings::env};

/// What `--shard` asks for; `auto` reads the scheduler's variables, with `count` where it does not tell how many.
///
/// # Errors
/// A usage error naming the option or variable.
pub(crate) fn shard(text: &str, count: Option<usize>) -> Result<Shard, CliError> {
    if text != "auto" {
        if count.is_some() {
            return Err(CliError::usage("--shard-count goes with --shard auto; I/N names its own count"));
        }
        return text.parse().map_err(|why| CliError::usage(format!("--shard {why}, or auto")));
    }
    automatic(count, &env).map_err(|why| CliError::usage(format!("--shard auto: {why}")))
}

fn automatic(count: Option<usize>, env: &dyn Fn(&str) -> Option<String>) -> Result<Shard, String> {
    let number = |name: &str| -> Result<Option<usize>, String> {
        let parse = |text: String| text.trim().parse().map_err(|_| format!("{name}: `{text}` is not a whole number"));
        env(name).map(parse).transpose()
    };
    if let Some(id) = number("SLURM_ARRAY_TASK_ID")? {
        let first = number("SLURM_ARRAY_TASK_MIN")?.unwrap_or(0);
        let step = number("SLURM_ARRAY_TASK_STEP")?.unwrap_or(1).max(1);
        let told = number("SLURM_ARRAY_TASK_COUNT")?;
        return slurm(id, first, step, count.or(told));
    }
    for (index, total) in [
        ("HQ_TASK_ID", None),
        ("AWS_BATCH_JOB_ARRAY_INDEX", Some("AWS_BATCH_JOB_ARRAY_SIZE")),
        ("JOB_COMPLETION_INDEX", None),
    ] {
        let Some(id) = number(index)? else { continue };
        let told = total.map(number).transpose()?.flatten();
        let Some(count) = count.or(told).filter(|&n| n > 0) else {
            return Err(format!("{index} is {id}, but how many tasks there are is not known; add --shard-count N"));
        };
        // Tasks may be numbered from 0 or from 1: either way N in a row are N different remainders.
        return Shard::new(id % count + 1, count).ok_or_else(|| "no such part".to_owned());
    }
    Err("no scheduler's variables are set (SLURM_ARRAY_TASK_ID, HQ_TASK_ID, AWS_BATCH_JOB_ARRAY_INDEX, \
         JOB_COMPLETION_INDEX); use --shard I/N"
        .to_owned())
}

fn slurm(id: usize, first: usize, step: usize, count: Option<usize>) -> Result<Shard, String> {
    let Some(count) = count else {
        return Err("SLURM_ARRAY_TASK_COUNT is not set; add --shard-count N".to_owned());
    };
    let index = id.checked_sub(first).filter(|d| d.is_multiple_of(step)).map(|d| d / step + 1);
    index.and_then(|index| Shard::new(index, count)).ok_or_else(|| {
        format!(
            "task {id} is not one of {count} in steps of {step} from {first}; use an array without gaps, or --shard I/N"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn auto(vars: &[(&str, &str)], count: Option<usize>) -> Result<(usize, usize), String> {
        let env = |name: &str| vars.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_owned());
        automatic(count, &env).map(|s| (s.index(), s.count()))
    }

    #[test]
    fn slurm_arrays_with_any_start_and_step_are_parts_in_order() {
        let task = |id: &'static str| {
            [
                ("SLURM_ARRAY_TASK_ID", id),
                ("SLURM_ARRAY_TASK_MIN", "10"),
                ("SLURM_ARRAY_TASK_STEP", "5"),
                ("SLURM_ARRAY_TASK_COUNT", "3"),
            ]
        };
        assert_eq!(auto(&task("10"), None), Ok((1, 3)));
        assert_eq!(auto(&task("20"), None), Ok((3, 3)));
        assert!(auto(&task("25"), None).is_err());
        assert!(auto(&task("12"), None).is_err());
        assert!(auto(&task("5"), None).is_err());
        assert!(auto(&task("x"), None).unwrap_err().contains("SLURM_ARRAY_TASK_ID"));
        assert!(auto(&[("SLURM_ARRAY_TASK_ID", "1")], None).unwrap_err().contains("--shard-count"));
    }

    #[test]
    fn other_schedulers_count_from_zero_or_one() {
        assert_eq!(auto(&[("AWS_BATCH_JOB_ARRAY_INDEX", "2"), ("AWS_BATCH_JOB_ARRAY_SIZE", "4")], None), Ok((3, 4)));
        assert_eq!(auto(&[("JOB_COMPLETION_INDEX", "0")], Some(2)), Ok((1, 2)));
        for first in [0, 1] {
            let mut parts: Vec<_> = (first..first + 4)
                .map(|id| auto(&[("HQ_TASK_ID", id.to_string().as_str())], Some(4)).unwrap().0)
                .collect();
            parts.sort_unstable();
            assert_eq!(parts, [1, 2, 3, 4]);
        }
        for name in ["HQ_TASK_ID", "JOB_COMPLETION_INDEX", "AWS_BATCH_JOB_ARRAY_INDEX"] {
            let error = auto(&[(name, "3")], None).unwrap_err();
            assert!(error.contains(name) && error.contains("--shard-count"), "{error}");
            assert!(auto(&[(name, "3")], Some(0)).is_err());
        }
        assert!(auto(&[], Some(4)).unwrap_err().contains("no scheduler"));
    }

    #[test]
    fn slurm_comes_before_the_others() {
        let vars = [("HQ_TASK_ID", "3"), ("SLURM_ARRAY_TASK_ID", "0"), ("SLURM_ARRAY_TASK_COUNT", "2")];
        assert_eq!(auto(&vars, None), Ok((1, 2)));
    }
}
