//! Trials on whatever device there is: software is enough. Where there is none, they show as ignored.

use std::sync::Arc;

use hdtrapeze_gpu::Device;
use libtest_mimic::{Arguments, Failed, Trial};

/// What a trial does.
pub type Check = Box<dyn FnOnce(&Arc<Device>) -> Result<(), Failed> + Send>;

/// Runs trials by name, and ends.
pub fn run(trials: Vec<(String, Check)>) {
    let arguments = Arguments::from_args();
    let device = Device::open().map(Arc::new);
    match &device {
        Ok(device) => println!("on {}", device.found().name),
        Err(error) => println!("ignored: {error}"),
    }
    let trial = |(name, check): (String, Check)| {
        let device = device.clone();
        let ignored = device.is_err();
        Trial::test(name, move || check(&device?)).with_ignored_flag(ignored)
    };
    let trials = trials.into_iter().map(trial).collect();
    libtest_mimic::run(&arguments, trials).exit();
}
