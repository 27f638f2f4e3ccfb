#include "primvars.h"

#include "numbers.h"

#include "pxr/imaging/hd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Where the host's Hydra can say it.
template <class Descriptor>
auto _ElementSize(Descriptor const& primvar, int) -> decltype(primvar.elementSize) {
    return primvar.elementSize;
}
template <class Descriptor> int _ElementSize(Descriptor const&, long) { return 1; }

// Hands on those samples that hold numbers of one kind; false where there is none.
bool _Send(HdTrapezeSyncing const& prim, HdPrimvarDescriptor const& primvar, int elementSize,
           HdTrapezeSamples<VtValue> const& samples, VtIntArray const& indices) {
    // The library's constants are Hydra's, but that it knows instancers' primvars by their prims.
    static_assert(TRZ_INTERPOLATION_UNIFORM == int(HdInterpolationUniform) &&
                  TRZ_INTERPOLATION_FACE_VARYING == int(HdInterpolationFaceVarying));
    bool const isOfPoints = primvar.interpolation == HdInterpolationVertex ||
                            primvar.interpolation == HdInterpolationVarying;
    auto desc = HdTrapezeStruct<trz_primvar>();
    desc.interpolation = primvar.interpolation == HdInterpolationInstance ? HdInterpolationVertex
                                                                          : primvar.interpolation;
    desc.role = primvar.role == HdPrimvarRoleTokens->color ? TRZ_ROLE_COLOR : TRZ_ROLE_NONE;
    desc.element_size = elementSize;
    desc.unauthored_index = -1;
    std::vector<double> times;
    std::vector<void const*> values;
    std::vector<size_t> counts;
    std::vector<size_t> indexCounts;
    for (size_t i = 0; i < samples.values.size(); ++i) {
        HdTrapezeNumbers numbers;
        if (!HdTrapezeNumbers::View(samples.values[i], &numbers) ||
            (!values.empty() && (numbers.type != desc.type || numbers.width != desc.width))) {
            continue;
        }
        desc.type = numbers.type;
        desc.width = numbers.width;
        times.push_back(samples.times[i]);
        values.push_back(numbers.data);
        counts.push_back(numbers.count);
        indexCounts.push_back(isOfPoints && numbers.count > 1 ? indices.size() : 0);
    }
    std::vector<int const*> const indexArrays(values.size(), indices.cdata());
    desc.times = times.data();
    desc.sample_count = times.size();
    desc.values = values.data();
    desc.value_counts = counts.data();
    desc.indices = indexArrays.data();
    desc.index_counts = indexCounts.data();
    return !values.empty() && prim.Edit(trz_prim_set_primvar, primvar.name.GetText(), &desc);
}

// Whether something besides AOVs needs a primvar.
bool _IsNeeded(TfToken const& name) {
    return name == HdTokens->displayColor || name == HdTokens->displayOpacity ||
           name == HdTokens->widths || name == HdTokens->normals;
}

} // namespace

void HdTrapezePrimvars::Sync(HdTrapezeSyncing const& prim, Of of, VtIntArray const& indices) {
    std::set<TfToken> const wanted = prim.param.WantedPrimvars();
    std::set<TfToken> sent;
    auto const send = [&](HdPrimvarDescriptor const& primvar, int elementSize, auto sample) {
        TfToken const& name = primvar.name;
        if ((_IsNeeded(name) || wanted.count(name)) && !sent.count(name) &&
            _Send(prim, primvar, elementSize, sample(), indices)) {
            sent.insert(name);
        }
    };
    for (int i = 0; i < HdInterpolationCount; ++i) {
        auto const interpolation = static_cast<HdInterpolation>(i);
        if ((interpolation == HdInterpolationInstance) != (of == Of::Instances)) {
            continue;
        }
        for (auto const& computed :
             prim.delegate->GetExtComputationPrimvarDescriptors(prim.id, interpolation)) {
            send(computed, 1,
                 [&] { return HdTrapezeSampleComputed(prim.delegate, computed, prim.shutter); });
        }
        for (auto const& primvar : prim.delegate->GetPrimvarDescriptors(prim.id, interpolation)) {
            send(primvar, _ElementSize(primvar, 0), [&] {
                return HdTrapezeSamplePrimvar(prim.delegate, prim.id, primvar.name, prim.shutter);
            });
        }
    }
    for (TfToken const& name : _sent) {
        if (!sent.count(name)) {
            prim.Edit(trz_prim_set_primvar, name.GetText(), nullptr);
        }
    }
    _sent = std::move(sent);
}

PXR_NAMESPACE_CLOSE_SCOPE
