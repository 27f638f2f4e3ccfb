#include "samples.h"

#include "pxr/imaging/hd/extComputationUtils.h"
#include "pxr/imaging/hd/version.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {
// Samples that are held without taking memory from the heap; there may be more.
constexpr unsigned int _capacity = 8;
// More samples than this of one computation are thinned out.
constexpr size_t _mostComputed = 32;
} // namespace

HdTrapezeSamples<GfMatrix4d> HdTrapezeSampleTransform(HdSceneDelegate* delegate, SdfPath const& id,
                                                      GfInterval const& shutter) {
    HdTimeSampleArray<GfMatrix4d, _capacity> samples;
#if HD_API_VERSION >= 68
    delegate->SampleTransform(id, shutter.GetMin(), shutter.GetMax(), &samples);
#else
    delegate->SampleTransform(id, &samples);
#endif
    return HdTrapezeSorted(samples);
}

HdTrapezeSamples<GfMatrix4d> HdTrapezeSampleInstancerTransform(HdSceneDelegate* delegate,
                                                               SdfPath const& id,
                                                               GfInterval const& shutter) {
    HdTimeSampleArray<GfMatrix4d, _capacity> samples;
#if HD_API_VERSION >= 68
    delegate->SampleInstancerTransform(id, shutter.GetMin(), shutter.GetMax(), &samples);
#else
    delegate->SampleInstancerTransform(id, &samples);
#endif
    return HdTrapezeSorted(samples);
}

HdTrapezeSamples<VtValue> HdTrapezeSamplePrimvar(HdSceneDelegate* delegate, SdfPath const& id,
                                                 TfToken const& name, GfInterval const& shutter) {
    HdTimeSampleArray<VtValue, _capacity> samples;
#if HD_API_VERSION >= 68
    delegate->SamplePrimvar(id, name, shutter.GetMin(), shutter.GetMax(), &samples);
#else
    delegate->SamplePrimvar(id, name, &samples);
#endif
    return HdTrapezeSorted(samples);
}

HdTrapezeSamples<VtValue>
HdTrapezeSampleComputed(HdSceneDelegate* delegate,
                        HdExtComputationPrimvarDescriptor const& descriptor,
                        GfInterval const& shutter) {
    HdExtComputationUtils::SampledValueStore<_capacity> store;
#if HD_API_VERSION >= 68
    HdExtComputationUtils::SampleComputedPrimvarValues<_capacity>(
        {descriptor}, delegate, shutter.GetMin(), shutter.GetMax(), _mostComputed, &store);
#else
    HdExtComputationUtils::SampleComputedPrimvarValues<_capacity>({descriptor}, delegate,
                                                                  _mostComputed, &store);
#endif
    auto const found = store.find(descriptor.name);
    return found == store.end() ? HdTrapezeSamples<VtValue>() : HdTrapezeSorted(found->second);
}

PXR_NAMESPACE_CLOSE_SCOPE
