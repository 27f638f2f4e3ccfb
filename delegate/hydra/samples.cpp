#include "samples.h"

#include "pxr/imaging/hd/extComputationUtils.h"
#include "pxr/imaging/hd/version.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {
// Calls f with the ends of the interval; without them where the scene delegate alone knows the
// shutter, as it did up to 24.05.
template <class F> void _Within(GfInterval const& shutter, F&& f) {
#if HD_API_VERSION >= 68
    f(static_cast<float>(shutter.GetMin()), static_cast<float>(shutter.GetMax()));
#else
    TF_UNUSED(shutter);
    f();
#endif
}

// Samples that are held without taking memory from the heap; there may be more.
constexpr unsigned int _capacity = 8;
// More samples than this of one computation are thinned out.
constexpr size_t _mostComputed = 32;
} // namespace

HdTrapezeSamples<GfMatrix4d> HdTrapezeSampleTransform(HdSceneDelegate* delegate, SdfPath const& id,
                                                      GfInterval const& shutter) {
    HdTimeSampleArray<GfMatrix4d, _capacity> samples;
    _Within(shutter,
            [&](auto... interval) { delegate->SampleTransform(id, interval..., &samples); });
    return HdTrapezeSorted(samples, [&] { return delegate->GetTransform(id); });
}

HdTrapezeSamples<GfMatrix4d> HdTrapezeSampleInstancerTransform(HdSceneDelegate* delegate,
                                                               SdfPath const& id,
                                                               GfInterval const& shutter) {
    HdTimeSampleArray<GfMatrix4d, _capacity> samples;
    _Within(shutter, [&](auto... interval) {
        delegate->SampleInstancerTransform(id, interval..., &samples);
    });
    return HdTrapezeSorted(samples, [&] { return delegate->GetInstancerTransform(id); });
}

HdTrapezeSamples<VtValue> HdTrapezeSamplePrimvar(HdSceneDelegate* delegate, SdfPath const& id,
                                                 TfToken const& name, GfInterval const& shutter) {
    HdTimeSampleArray<VtValue, _capacity> samples;
    _Within(shutter,
            [&](auto... interval) { delegate->SamplePrimvar(id, name, interval..., &samples); });
    return HdTrapezeSorted(samples, [&] { return delegate->Get(id, name); });
}

HdTrapezeSamples<VtValue>
HdTrapezeSampleComputed(HdSceneDelegate* delegate,
                        HdExtComputationPrimvarDescriptor const& descriptor,
                        GfInterval const& shutter) {
    HdExtComputationUtils::SampledValueStore<_capacity> store;
    _Within(shutter, [&](auto... interval) {
        HdExtComputationUtils::SampleComputedPrimvarValues<_capacity>(
            {descriptor}, delegate, interval..., _mostComputed, &store);
    });
    auto const found = store.find(descriptor.name);
    if (found == store.end()) {
        return {};
    }
    return HdTrapezeSorted(found->second, [&] { return found->second.values[0]; });
}

PXR_NAMESPACE_CLOSE_SCOPE
