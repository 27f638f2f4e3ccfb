//! The committed header is what cbindgen makes of the sources.
//!
//! To write it anew: `TRZ_WRITE_HEADER=1 cargo test -p hdtrapeze-capi --test header`.

use std::path::Path;

const SOURCES: [&str; 14] = [
    "constants",
    "types",
    "session",
    "scene",
    "instancer",
    "setting",
    "frame_name",
    "path",
    "words",
    "render",
    "view",
    "plan",
    "output",
    "device",
];

fn generated() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml")).expect("cbindgen.toml");
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in SOURCES {
        builder = builder.with_src(root.join("src").join(source).with_extension("rs"));
    }
    let mut bytes = Vec::new();
    builder.generate().expect("header").write(&mut bytes);
    String::from_utf8(bytes).expect("UTF-8")
}

#[test]
fn committed_header_is_generated() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/hdtrapeze.h");
    let generated = generated();
    if std::env::var_os("TRZ_WRITE_HEADER").is_some() {
        std::fs::write(&path, &generated).expect("writable header");
    }
    let committed = std::fs::read_to_string(&path).expect("header");
    assert!(
        committed == generated,
        "include/hdtrapeze.h has drifted; write it anew with TRZ_WRITE_HEADER=1"
    );
}

#[test]
fn every_source_is_in_the_header() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let header = generated();
    for entry in std::fs::read_dir(root).expect("src") {
        let path = entry.expect("entry").path();
        if path.is_dir() {
            continue;
        }
        let text = std::fs::read_to_string(path).expect("source");
        for line in text.lines() {
            let Some((_, rest)) = line.split_once("extern \"C\" fn ") else {
                continue;
            };
            let name = rest.split('(').next().unwrap_or_default();
            assert!(
                name.is_empty() || header.contains(&format!("{name}(")),
                "{name} is missing"
            );
        }
    }
}
