#include "primvars.h"

#include "numbers.h"
#include "samples.h"

#include "pxr/imaging/hd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Where the host's Hydra can say it.
template <class Descriptor>
auto _ElementSize(Descriptor const& primvar, int) -> decltype(primvar.elementSize) {
    return primvar.elementSize;
}
template <class Descriptor> int _ElementSize(Descriptor const&, long) { return 1; }

uint32_t _Interpolation(HdInterpolation interpolation) {
    switch (interpolation) {
    case HdInterpolationUniform:
        return TRZ_INTERPOLATION_UNIFORM;
    case HdInterpolationVarying:
        return TRZ_INTERPOLATION_VARYING;
    case HdInterpolationVertex:
    case HdInterpolationInstance:
        return TRZ_INTERPOLATION_VERTEX;
    case HdInterpolationFaceVarying:
        return TRZ_INTERPOLATION_FACE_VARYING;
    default:
        return TRZ_INTERPOLATION_CONSTANT;
    }
}

// Hands on those samples that hold numbers of one kind; false where there is none.
bool _Send(SdfPath const& id, trz_id prim, HdPrimvarDescriptor const& primvar, int elementSize,
           HdTrapezeSamples<VtValue> const& samples, VtIntArray const& indices,
           HdTrapezeRenderParam& param) {
    bool const isOfPoints = primvar.interpolation == HdInterpolationVertex ||
                            primvar.interpolation == HdInterpolationVarying;
    trz_primvar desc = {};
    desc.struct_size = sizeof(desc);
    desc.interpolation = _Interpolation(primvar.interpolation);
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
    if (values.empty()) {
        return false;
    }
    std::vector<int const*> const indexArrays(values.size(), indices.cdata());
    desc.times = times.data();
    desc.sample_count = times.size();
    desc.values = values.data();
    desc.value_counts = counts.data();
    desc.indices = indexArrays.data();
    desc.index_counts = indexCounts.data();
    return param.Edit(trz_prim_set_primvar(param.Session(), prim, primvar.name.GetText(), &desc),
                      id);
}

// Whether something besides AOVs needs a primvar.
bool _IsNeeded(TfToken const& name) {
    return name == HdTokens->displayColor || name == HdTokens->displayOpacity ||
           name == HdTokens->widths || name == HdTokens->normals;
}

} // namespace

void HdTrapezePrimvars::Sync(Of of, SdfPath const& id, trz_id prim, VtIntArray const& indices,
                             HdSceneDelegate* delegate, HdTrapezeRenderParam& param) {
    GfInterval const shutter = param.Shutter();
    std::set<TfToken> const wanted = param.WantedPrimvars();
    std::set<TfToken> sent;
    auto const isWanted = [&](TfToken const& name) {
        return (_IsNeeded(name) || wanted.count(name)) && !sent.count(name);
    };
    auto const send = [&](HdPrimvarDescriptor const& primvar, int elementSize,
                          HdTrapezeSamples<VtValue> const& samples) {
        if (_Send(id, prim, primvar, elementSize, samples, indices, param)) {
            sent.insert(primvar.name);
        }
    };
    for (int i = 0; i < HdInterpolationCount; ++i) {
        auto const interpolation = static_cast<HdInterpolation>(i);
        if ((interpolation == HdInterpolationInstance) != (of == Of::Instances)) {
            continue;
        }
        for (auto const& computed :
             delegate->GetExtComputationPrimvarDescriptors(id, interpolation)) {
            if (isWanted(computed.name)) {
                send(computed, 1, HdTrapezeSampleComputed(delegate, computed, shutter));
            }
        }
        for (auto const& primvar : delegate->GetPrimvarDescriptors(id, interpolation)) {
            if (isWanted(primvar.name)) {
                send(primvar, _ElementSize(primvar, 0),
                     HdTrapezeSamplePrimvar(delegate, id, primvar.name, shutter));
            }
        }
    }
    for (TfToken const& name : _sent) {
        if (!sent.count(name)) {
            param.Edit(trz_prim_set_primvar(param.Session(), prim, name.GetText(), nullptr), id);
        }
    }
    _sent = std::move(sent);
}

PXR_NAMESPACE_CLOSE_SCOPE
