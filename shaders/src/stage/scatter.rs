//! The text of the stages around `occlude`: what sends rays from first hits, puts them in order, and sums up what they met.

/// Invocations of a workgroup of the stages `site`, `scatter`, `order` and `share`.
pub const SCATTER_WORKGROUP: u32 = 64;

/// The WGSL of the stage `site`, where something moves with `time`; its entry point is `site`.
pub fn site_source(time: bool) -> String {
    let fixed = format!("const TIME: bool = {time};\n");
    [
        fixed.as_str(),
        crate::layout::SOURCE,
        include_str!("../wgsl/keys.wgsl"),
        include_str!("../wgsl/facet.wgsl"),
        include_str!("../wgsl/place.wgsl"),
        include_str!("../wgsl/placed.wgsl"),
        include_str!("../wgsl/site.wgsl"),
    ]
    .concat()
}

/// The WGSL of the stage `scatter`, for samples of a net or of Sobol's; its entry point is `scatter`.
pub fn scatter_source(net: bool) -> String {
    let samples = super::GeneratePermutation {
        net,
        lens: super::LensKind::Pinhole,
        time: super::TimeKind::Still,
        lens_changes: false,
    };
    [
        samples.samples().as_str(),
        crate::layout::SOURCE,
        include_str!("../wgsl/circle.wgsl"),
        include_str!("../wgsl/scatter.wgsl"),
    ]
    .concat()
}

/// The WGSL of the stage `order`; its entry point is `order`.
pub fn order_source() -> String {
    [crate::layout::SOURCE, include_str!("../wgsl/order.wgsl")].concat()
}

/// The WGSL of the stage `share`; its entry point is `share`.
pub fn share_source() -> String {
    [crate::layout::SOURCE, include_str!("../wgsl/share.wgsl")].concat()
}

#[cfg(test)]
mod tests {
    use super::super::tests::check;
    use super::*;

    #[test]
    fn every_permutation_is_valid() {
        let workgroup = [SCATTER_WORKGROUP, 1, 1];
        for time in [false, true] {
            check(&site_source(time), &[("site", workgroup)]);
        }
        for net in [false, true] {
            check(&scatter_source(net), &[("scatter", workgroup)]);
        }
        check(&order_source(), &[("order", workgroup)]);
        check(&share_source(), &[("share", workgroup)]);
    }
}
