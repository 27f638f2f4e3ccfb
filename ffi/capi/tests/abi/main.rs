//! The C ABI as a caller sees it: null and bad arguments, threads, cancelling, messages, panics.

#![allow(unsafe_code)]

mod ahead;
mod arguments;
mod files;
mod frame_names;
mod lifecycle;
mod messages;
mod motion;
mod nulls;
mod panics;
mod paths;
mod plans;
mod rays;
mod settings;
mod shapes;
mod support;
mod threads;
mod views;
mod words;
