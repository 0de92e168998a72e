//! The program as scripts see it: help, usage errors, exit codes, generated texts.
#![cfg(feature = "cli")]

use assert_cmd::Command;

const KINORA: &str = env!("CARGO_BIN_EXE_kinora");

fn kinora(args: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = Command::new(KINORA);
    for variable in ["KINORA_THREADS", "SLURM_CPUS_PER_TASK", "HQ_CPUS"] {
        command.env_remove(variable);
    }
    command.args(args).assert()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn stdout_of(args: &[&str]) -> String {
    text(&kinora(args).code(0).get_output().stdout)
}

/// Runs what must be a usage error, with nothing on stdout, and gives its message.
fn usage_error(args: &[&str]) -> String {
    let assert = kinora(args).code(2);
    let output = assert.get_output();
    assert!(output.stdout.is_empty(), "{args:?}");
    text(&output.stderr)
}

#[test]
fn help_names_every_command_option_and_unit() {
    let help = stdout_of(&["--help"]);
    for command in ["render", "info", "pose", "cast", "completions", "man"] {
        assert!(help.contains(command), "{command}:\n{help}");
    }
    let help = stdout_of(&["render", "--help"]);
    for word in [
        "--output",
        "--frames",
        "--fps",
        "--size",
        "--samples",
        "--shading",
        "--camera",
        "--resume",
        "--overwrite",
        "--shard",
        "--seed",
        "--animation",
        "--json",
        "--threads",
        "--accel",
        "--top",
        "--precision",
        "--simd",
        "pixels",
        "seconds",
    ] {
        assert!(help.contains(word), "{word}:\n{help}");
    }
    for kind in kinora::accel::AccelKind::ALL {
        assert!(help.contains(kind.name()), "{}:\n{help}", kind.name());
    }
    assert!(stdout_of(&["pose", "--help"]).contains("<SECONDS>"));
}

#[test]
fn version_is_the_package_version() {
    assert_eq!(stdout_of(&["--version"]), format!("kinora {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn no_command_is_a_usage_error_with_the_help() {
    let assert = kinora(&[]).code(2);
    assert!(text(&assert.get_output().stderr).contains("Usage: kinora"));
}

#[test]
fn wrong_options_end_in_2_with_the_option_named() {
    for (args, named) in [
        (&["render", "--threads", "0"][..], "threads"),
        (&["render", "--threads", "x"], "--threads"),
        (&["render", "--accel", "octree"], "bvh2"),
        (&["render", "--accel", "bvh2:colour=red"], "colour"),
        (&["render", "--top", "grid"], "--top"),
        (&["render", "--precision", "best"], "exact"),
        (&["render", "--simd", "neon"], "scalar"),
        (&["render", "-q", "-v"], "--verbose"),
        (&["render", "--frames", "5-1"], "ends before"),
        (&["render", "--frames", "-5"], "--frames"),
        (&["render", "--frames", "1x2"], "range"),
        (&["render", "--frames", "0-99999999"], "more than"),
        (&["render", "--fps", "0"], "--fps"),
        (&["render", "--fps", "-30"], "--fps"),
        (&["render", "--fps", "nan"], "--fps"),
        (&["render", "--size", "1280"], "WIDTHxHEIGHT"),
        (&["render", "--size", "0x720"], "--size"),
        (&["render", "--size", "99999x99999"], "area"),
        (&["render", "--samples", "0"], "--samples"),
        (&["render", "--shading", "toon"], "eyelight"),
        (&["render", "--seed", "-1"], "--seed"),
        (&["render", "--resume", "--overwrite"], "--overwrite"),
        (&["render", "--shard", "0/4"], "1 to N"),
        (&["render", "--shard", "5/4"], "1 to N"),
        (&["render", "--shard", "half"], "I/N"),
        (&["render", "--shard", "1/2", "--shard-count", "2"], "--shard-count"),
        (&["render", "--shard-count", "2"], "--shard"),
        (&["render", "--shard", "1/2", "--output", "a.gif"], "a.gif"),
        (&["render", "--output", "a.jpg"], ".png"),
        (&["render", "--output", "a_#_#.png"], "run of #"),
        (&["render", "--output", "a_#.gif"], "#"),
        (&["render", "--output", "-", "--json"], "stdout"),
        (&["render", "--output", "-", "--resume"], "--resume"),
        (&["render", "--policy", "never"], "swap-every"),
        (&["render", "--chroma", "411"], "444"),
        (&["render", "--exr-color", "double"], "half"),
        (&["render", "--wobble"], "--wobble"),
        (&["completions", "tcsh"], "bash"),
        (&["man", "fly"], "fly"),
        (&["fly"], "fly"),
    ] {
        let message = usage_error(args);
        assert!(message.contains(named), "{args:?} must name {named}: {message}");
        assert!(!message.contains("panicked"), "{args:?}: {message}");
    }
}

#[test]
fn missing_and_wrong_scenes_end_in_2_with_the_file_named() {
    let folder = tempfile::tempdir().unwrap();
    let wrong = folder.path().join("wrong.glb");
    std::fs::write(&wrong, b"glTF\x02\0\0\0").unwrap();
    let wrong = wrong.to_str().unwrap();
    let out = folder.path().join("out");
    let out = out.join("f_#.png");
    for scene in ["no/such/file.glb", wrong, "builtin:nobody"] {
        for command in [&["info"][..], &["render", "--output", out.to_str().unwrap()]] {
            let args: Vec<&str> = command.iter().copied().chain([scene]).collect();
            let message = usage_error(&args);
            assert!(message.contains(scene), "{args:?}: {message}");
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }
    assert!(!folder.path().join("out").exists(), "nothing is made before the scene is good");
    assert!(usage_error(&["info", "builtin:nobody"]).contains("walk"));
}

#[test]
fn threads_come_from_the_flag_then_the_environment() {
    let run = |variables: &[(&str, &str)], args: &[&str]| {
        let mut command = Command::new(KINORA);
        for variable in ["KINORA_THREADS", "SLURM_CPUS_PER_TASK", "HQ_CPUS"] {
            command.env_remove(variable);
        }
        command.envs(variables.iter().copied()).args(["info", "--list-builtin"]).args(args).assert()
    };
    let message = text(&run(&[("KINORA_THREADS", "many")], &[]).code(2).get_output().stderr);
    assert!(message.contains("KINORA_THREADS"), "{message}");
    run(&[("KINORA_THREADS", "0")], &[]).code(2);
    run(&[("KINORA_THREADS", "many")], &["--threads", "1"]).code(0);
    run(&[("SLURM_CPUS_PER_TASK", "nonsense"), ("HQ_CPUS", "0,1")], &[]).code(0);
}

#[test]
fn completions_know_commands_and_options_in_every_shell() {
    // The generators for the other two shells complete no values.
    for (shell, values) in [("bash", true), ("zsh", true), ("fish", true), ("powershell", false), ("elvish", false)] {
        let script = stdout_of(&["completions", shell]);
        for word in ["render", "shading", "overwrite"].into_iter().chain(values.then_some("eyelight")) {
            assert!(script.contains(word), "{shell} lacks {word}");
        }
    }
}

#[test]
fn manual_pages_are_roff_with_the_options() {
    let page = stdout_of(&["man"]);
    assert!(page.contains(".TH") && page.contains("kinora\\-render"), "{page}");
    let page = stdout_of(&["man", "render"]);
    assert!(page.contains(".TH") && page.contains("\\-\\-frames"), "{page}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_stdout_is_a_failure_not_a_panic() {
    let full = || std::fs::File::options().write(true).open("/dev/full").unwrap();
    for args in [&["man"][..], &["completions", "bash"]] {
        let mut command = std::process::Command::new(KINORA);
        let output = command.args(args).stdout(full()).output().unwrap();
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{args:?}: {message}");
        assert!(message.contains("stdout: cannot write"), "{message}");
    }
}
