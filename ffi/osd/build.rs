//! Builds the C++ half of the bridge and links OpenSubdiv's CPU library.
//!
//! `OPENSUBDIV_ROOT` names an installation prefix (with `include/opensubdiv` and `lib`) to use in
//! place of the system's.

use std::path::{Path, PathBuf};

const HEADER: &str = "opensubdiv/bfr/refinerSurfaceFactory.h";

fn main() {
    println!("cargo::rerun-if-env-changed=OPENSUBDIV_ROOT");
    for file in [
        "build.rs",
        "src/bridge.rs",
        "src/cpp/bridge.h",
        "src/cpp/bridge.cc",
    ] {
        println!("cargo::rerun-if-changed={file}");
    }

    let root = std::env::var_os("OPENSUBDIV_ROOT").map(PathBuf::from);
    let includes: Vec<PathBuf> = match &root {
        Some(root) => vec![root.join("include")],
        None => [
            "/usr/include",
            "/usr/local/include",
            "/opt/homebrew/include",
        ]
        .iter()
        .map(PathBuf::from)
        .collect(),
    };
    let Some(include) = includes.iter().find(|dir| dir.join(HEADER).is_file()) else {
        let tried: Vec<String> = includes
            .iter()
            .map(|dir| dir.display().to_string())
            .collect();
        eprintln!(
            "\nOpenSubdiv 3.5 or newer was not found: no {HEADER} in {}.\n\
             On Debian or Ubuntu:  apt-get install libosd-dev\n\
             For an installation of your own:  export OPENSUBDIV_ROOT=PREFIX\n",
            tried.join(", ")
        );
        std::process::exit(1);
    };

    let mut build = cxx_build::bridge("src/bridge.rs");
    build
        .file("src/cpp/bridge.cc")
        .std("c++17")
        .flag("-fvisibility=hidden")
        .flag("-fvisibility-inlines-hidden")
        // The same point must give the same bits on every path.
        .flag_if_supported("-ffp-contract=off")
        .flag_if_supported("-Wno-unused-parameter");
    if include != Path::new("/usr/include") {
        build.include(include);
    }
    build.compile("hdtrapeze_osd_bridge");

    if let Some(root) = &root {
        for lib in ["lib", "lib64"] {
            let dir = root.join(lib);
            if dir.is_dir() {
                println!("cargo::rustc-link-search=native={}", dir.display());
            }
        }
    } else if include != Path::new("/usr/include") {
        let dir = include.with_file_name("lib");
        println!("cargo::rustc-link-search=native={}", dir.display());
    }
    println!("cargo::rustc-link-lib=dylib=osdCPU");
}
