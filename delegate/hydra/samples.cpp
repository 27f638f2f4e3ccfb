#include "samples.h"

#include "arcs.h"

#include "pxr/base/gf/matrix3f.h"
#include "pxr/base/gf/matrix4f.h"
#include "pxr/base/vt/array.h"
#include "pxr/imaging/hd/extComputationUtils.h"
#include "pxr/imaging/hd/version.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Calls f with the ends of the interval; without them where f takes none: the scene delegate alone
// knows the shutter up to 24.05, and with ext computations up to 24.08.
template <bool takesInterval, class F> void _Within(GfInterval const& shutter, F&& f) {
    if constexpr (takesInterval) {
        f(static_cast<float>(shutter.GetMin()), static_cast<float>(shutter.GetMax()));
    } else {
        TF_UNUSED(shutter);
        f();
    }
}

// Samples that are held without taking memory from the heap; there may be more.
constexpr unsigned int _capacity = 8;
// More samples than this of one computation are left out.
constexpr size_t _mostComputed = 32;

using _Times = std::vector<float>;

// Computations are evaluated at the times of all inputs together, where inputs are interpolated;
// but those of matrices of floats, such as a skeleton's, are held. Adds the times of these, of the
// computation and those that it depends on.
void _AddHeldTimes(HdSceneDelegate* delegate, SdfPath const& computation, GfInterval const& shutter,
                   std::vector<_Times>* all) {
    for (TfToken const& input : delegate->GetExtComputationSceneInputNames(computation)) {
        HdTimeSampleArray<VtValue, _capacity> samples;
        _Within<(HD_API_VERSION >= 68)>(shutter, [&](auto... interval) {
            delegate->SampleExtComputationInput(computation, input, interval..., &samples);
        });
        if (samples.count > 1 && (samples.values[0].IsHolding<VtArray<GfMatrix4f>>() ||
                                  samples.values[0].IsHolding<VtArray<GfMatrix3f>>())) {
            all->emplace_back(samples.times.begin(), samples.times.begin() + samples.count);
        }
    }
    for (auto const& input : delegate->GetExtComputationInputDescriptors(computation)) {
        _AddHeldTimes(delegate, input.sourceComputationId, shutter, all);
    }
}

} // namespace

// Hosts give transforms where something is authored and at the shutter's ends. Where one turns,
// more samples follow it, or else the renderer turns it. The frame's own may still lie off the line
// between two of them: it is a sample, too, since a still image shows it.
HdTrapezeTransform HdTrapezeSampleTransform(HdSceneDelegate* delegate, SdfPath const& id,
                                            GfInterval const& shutter, bool isInstancer) {
    HdTimeSampleArray<GfMatrix4d, _capacity> given;
    _Within<(HD_API_VERSION >= 68)>(shutter, [&](auto... interval) {
        isInstancer ? delegate->SampleInstancerTransform(id, interval..., &given)
                    : delegate->SampleTransform(id, interval..., &given);
    });
    auto const plain = [&] {
        return isInstancer ? delegate->GetInstancerTransform(id) : delegate->GetTransform(id);
    };
    HdTrapezeTransform samples{HdTrapezeSorted(given, plain)};
    samples.turns = !HdTrapezeAddArcs(delegate, id, shutter, &samples) && samples.times.size() > 1;
    samples.turns |= HdTrapezeAddFrame(&samples, plain) ? 2 : 0;
    return samples;
}

HdTrapezeSamples<VtValue> HdTrapezeSamplePrimvar(HdSceneDelegate* delegate, SdfPath const& id,
                                                 TfToken const& name, GfInterval const& shutter) {
    HdTimeSampleArray<VtValue, _capacity> samples;
    _Within<(HD_API_VERSION >= 68)>(shutter, [&](auto... interval) {
        delegate->SamplePrimvar(id, name, interval..., &samples);
    });
    return HdTrapezeSorted(samples, [&] { return delegate->Get(id, name); });
}

HdTrapezeSamples<VtValue>
HdTrapezeSampleComputed(HdSceneDelegate* delegate,
                        HdExtComputationPrimvarDescriptor const& descriptor,
                        GfInterval const& shutter) {
    HdExtComputationUtils::SampledValueStore<_capacity> store;
    _Within<(HD_API_VERSION >= 73)>(shutter, [&](auto... interval) {
        HdExtComputationUtils::SampleComputedPrimvarValues<_capacity>(
            {descriptor}, delegate, interval..., _mostComputed, &store);
    });
    auto const found = store.find(descriptor.name);
    if (found == store.end()) {
        return {};
    }
    auto const sorted = HdTrapezeSorted(found->second, [&] { return found->second.values[0]; });
    if (sorted.times.size() < 2) {
        return sorted;
    }
    std::vector<_Times> held;
    _AddHeldTimes(delegate, descriptor.sourceComputationId, shutter, &held);
    HdTrapezeSamples<VtValue> samples;
    for (size_t i = 0; i < sorted.times.size(); ++i) {
        auto const has = [&](_Times const& times) {
            return std::count(times.begin(), times.end(), static_cast<float>(sorted.times[i])) > 0;
        };
        if (std::all_of(held.begin(), held.end(), has)) {
            samples.times.push_back(sorted.times[i]);
            samples.values.push_back(sorted.values[i]);
        }
    }
    return samples.times.empty() ? sorted : samples;
}

PXR_NAMESPACE_CLOSE_SCOPE
