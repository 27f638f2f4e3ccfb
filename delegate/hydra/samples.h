#ifndef HDTRAPEZE_SAMPLES_H
#define HDTRAPEZE_SAMPLES_H

#include "pxr/base/gf/interval.h"
#include "pxr/base/gf/matrix4d.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/imaging/hd/timeSampleArray.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// Values over time: times are time codes relative to the frame, ascending, none twice. They may
/// lie outside of the interval that was asked for: what brackets it is part of it.
template <class T> struct HdTrapezeSamples {
    std::vector<double> times;
    std::vector<T> values;
};

/// Matrices of a transform over time.
struct HdTrapezeTransform : HdTrapezeSamples<GfMatrix4d> {
    /// As the C ABI's: 1 where between samples it goes along arcs, since the host cannot tell how;
    /// and 2 where the sample at the frame shows whether it does.
    uint32_t turns = 0;
};

/// Sorts what a scene delegate gave. At the default time, some give times that are no numbers, with
/// values of any time: then the one that `plain` gives counts.
template <class T, unsigned int Capacity, class F>
HdTrapezeSamples<T> HdTrapezeSorted(HdTimeSampleArray<T, Capacity> const& given, F&& plain) {
    if (given.count > 0 && !std::isfinite(given.times[0])) {
        return {{0.0}, {plain()}};
    }
    std::vector<size_t> order(given.count);
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return given.times[a] < given.times[b]; });
    HdTrapezeSamples<T> samples;
    for (size_t i : order) {
        if (samples.times.empty() || samples.times.back() < given.times[i]) {
            samples.times.push_back(given.times[i]);
            samples.values.push_back(given.values[i]);
        }
    }
    return samples;
}

/// The value at a time, linear between samples and held outside; `fallback` where there are none.
template <class T>
T HdTrapezeAt(HdTrapezeSamples<T> const& samples, double time, T const& fallback) {
    auto const& times = samples.times;
    if (times.empty()) {
        return fallback;
    }
    size_t const after = std::upper_bound(times.begin(), times.end(), time) - times.begin();
    if (after == 0 || after == times.size()) {
        return after == 0 ? samples.values.front() : samples.values.back();
    }
    T const& before = samples.values[after - 1];
    double const part = (time - times[after - 1]) / (times[after] - times[after - 1]);
    return before + part * (samples.values[after] - before);
}

/// Those samples that are a T, or can become one.
template <class T> HdTrapezeSamples<T> HdTrapezeCast(HdTrapezeSamples<VtValue> const& samples) {
    HdTrapezeSamples<T> cast;
    for (size_t i = 0; i < samples.values.size(); ++i) {
        VtValue const value = VtValue::Cast<T>(samples.values[i]);
        if (value.IsHolding<T>()) {
            cast.times.push_back(samples.times[i]);
            cast.values.push_back(value.UncheckedGet<T>());
        }
    }
    return cast;
}

/// The times of all that change, ascending.
template <class T> std::vector<double> HdTrapezeTimes(std::vector<T> const& tracks) {
    std::set<double> times;
    for (T const& track : tracks) {
        if (track.times.size() > 1) {
            times.insert(track.times.begin(), track.times.end());
        }
    }
    return {times.begin(), times.end()};
}

/// Adds the frame's own value where samples lie around it, and none at it; true then.
template <class T, class F> bool HdTrapezeAddFrame(HdTrapezeSamples<T>* samples, F&& plain) {
    auto& times = samples->times;
    auto const after = std::lower_bound(times.begin(), times.end(), 0.0);
    if (after == times.begin() || after == times.end() || *after == 0.0) {
        return false;
    }
    samples->values.insert(samples->values.begin() + (after - times.begin()), plain());
    times.insert(after, 0.0);
    return true;
}

/// The transform of a prim or of an instancer, to the space of the prototype that it is part of or
/// to the world.
HdTrapezeTransform HdTrapezeSampleTransform(HdSceneDelegate* delegate, SdfPath const& id,
                                            GfInterval const& shutter, bool isInstancer = false);

/// A primvar or an attribute that Hydra treats as one; no samples where there is no value.
HdTrapezeSamples<VtValue> HdTrapezeSamplePrimvar(HdSceneDelegate* delegate, SdfPath const& id,
                                                 TfToken const& name, GfInterval const& shutter);

/// A primvar that an ext computation gives, skinned points above all.
HdTrapezeSamples<VtValue>
HdTrapezeSampleComputed(HdSceneDelegate* delegate,
                        HdExtComputationPrimvarDescriptor const& descriptor,
                        GfInterval const& shutter);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
