//! The small run checks every tracer that is installed, and prints its tables.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

/// Runs the bench, and gives the tables that it wrote, which are those it printed.
fn tables(options: &[&str]) -> String {
    let name = format!("peers-{}-{}.md", std::process::id(), options.join("-"));
    let file = std::env::temp_dir().join(name);
    let output = Command::new(env!("CARGO_BIN_EXE_peers"))
        .args(options)
        .arg("--markdown")
        .arg(&file)
        .output()
        .expect("the bench starts");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    let written = std::fs::read_to_string(&file).expect("the tables");
    let _ = std::fs::remove_file(&file);
    assert_eq!(written, String::from_utf8_lossy(&output.stdout));
    for text in [
        "### Camera rays",
        "sheet static",
        "patches moving",
        "fur moving",
        "combed moving",
    ] {
        assert!(written.contains(text), "{text} is missing:\n{written}");
    }
    written
}

#[test]
fn the_small_run_agrees_with_what_is_installed() {
    let text = tables(&["--quick"]);
    let found = text.contains("### Answers compared") && text.contains("| GRID compact");
    assert!(found || text.contains("Embree: not found"), "{text}");
}

#[test]
fn frames_have_a_table() {
    let text = tables(&["--quick", "--alone", "--frames"]);
    let table = text.split("### Oriented frames").nth(1).expect("a table");
    assert_eq!(table.matches("| camera").count(), 8, "{text}");
}

#[test]
fn ours_alone_has_tables_too() {
    let text = tables(&["--quick", "--alone"]);
    assert!(text.starts_with("Embree: left out"), "{text}");
    for title in ["### Every variant", "### Oriented frames"] {
        assert!(!text.contains(title), "{text}");
    }
}

#[test]
fn an_unknown_option_fails() {
    let output = Command::new(env!("CARGO_BIN_EXE_peers"))
        .arg("--bogus")
        .output();
    assert_eq!(output.expect("the bench starts").status.code(), Some(2));
}

#[test]
fn who_has_read_enough_is_no_error() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_peers"))
        .args(["--quick", "--alone", "--scene", "sheet"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the bench starts");
    let mut line = String::new();
    let mut reader = BufReader::new(child.stdout.take().expect("a pipe"));
    reader.read_line(&mut line).expect("a line");
    drop(reader);
    assert_eq!(line, "Embree: left out\n");
    assert!(child.wait().expect("an end").success());
}
