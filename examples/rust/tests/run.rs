//! Both example programs are built and run, and what they print is looked at.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs a program and returns what it printed; it must succeed and write an EXR.
fn run(command: &mut Command, image: &Path) -> String {
    // The last run's image must not stand for this one's.
    let _ = fs::remove_file(image);
    let done = command.arg(image).output().expect("the program starts");
    let errors = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{errors}");
    let bytes = fs::read(image).expect("an image");
    assert_eq!(bytes[..4], [0x76, 0x2f, 0x31, 0x01], "OpenEXR's magic");
    String::from_utf8(done.stdout).expect("UTF-8")
}

fn image(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// The folder that holds the shared library which this test's build made.
fn library_folder() -> PathBuf {
    let test = std::env::current_exe().expect("the test's path");
    test.parent().expect("a folder").to_owned()
}

#[test]
fn rust_program() {
    let mut program = Command::new(env!("CARGO_BIN_EXE_trapeze-example"));
    let printed = run(&mut program, &image("rust.exr"));
    assert!(printed.contains("time 0.00: miss"), "{printed}");
    assert!(printed.contains("time 0.50: prim 7 at t 7."), "{printed}");
    assert!(printed.contains("time 1.00: miss"), "{printed}");
}

#[test]
fn c_program() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let program = image("trapeze-c");
    let libraries = library_folder();
    let done = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"])
        .arg("-I")
        .arg(root.join("ffi/capi/include"))
        .arg(root.join("examples/c/trapeze.c"))
        .arg("-L")
        .arg(&libraries)
        .args(["-lhdtrapeze", "-lm", "-o"])
        .arg(&program)
        .output()
        .expect("a C compiler is installed");
    let errors = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{errors}");
    let mut command = Command::new(&program);
    command.env("LD_LIBRARY_PATH", &libraries);
    let printed = run(&mut command, &image("c.exr"));
    assert!(printed.contains(" micropolygons, "), "{printed}");
    assert!(
        printed.contains("time 0.00: prim 2 at t 9.000"),
        "{printed}"
    );
    assert!(
        printed.contains("time 0.25: prim 2 at t 9.000"),
        "{printed}"
    );
    assert!(printed.contains("time 1.00: miss"), "{printed}");

    let usage = Command::new(&program)
        .env("LD_LIBRARY_PATH", &libraries)
        .output();
    assert_eq!(usage.expect("starts").status.code(), Some(2));
}
