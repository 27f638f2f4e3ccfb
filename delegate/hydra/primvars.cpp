#include "primvars.h"

#include "numbers.h"
#include "samples.h"
#include "selection.h"

#include "pxr/imaging/hd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Where the host's Hydra can say it.
template <class Descriptor>
auto _ElementSize(Descriptor const& primvar, int) -> decltype(primvar.elementSize) {
    return primvar.elementSize;
}
template <class Descriptor> int _ElementSize(Descriptor const&, long) { return 1; }

// All values of those samples that hold numbers of one kind.
void _View(HdTrapezeSamples<VtValue> const& samples, trz_primvar* desc, std::vector<double>* times,
           std::vector<void const*>* values, std::vector<size_t>* counts) {
    for (size_t i = 0; i < samples.values.size(); ++i) {
        HdTrapezeNumbers numbers;
        if (!HdTrapezeNumbers::View(samples.values[i], &numbers)) {
            continue;
        }
        if (!values->empty() && (numbers.type != desc->type || numbers.width != desc->width)) {
            continue;
        }
        desc->type = numbers.type;
        desc->width = numbers.width;
        times->push_back(samples.times[i]);
        values->push_back(numbers.data);
        counts->push_back(numbers.count);
    }
}

bool _Send(SdfPath const& id, trz_id prim, TfToken const& name, HdInterpolation interpolation,
           TfToken const& role, int elementSize, HdTrapezeSamples<VtValue> const& samples,
           VtIntArray const& indices, HdTrapezeRenderParam& param) {
    trz_primvar desc = {};
    desc.struct_size = sizeof(desc);
    desc.interpolation = HdTrapezeInterpolation(interpolation);
    desc.role = role == HdPrimvarRoleTokens->color ? TRZ_ROLE_COLOR : TRZ_ROLE_NONE;
    desc.element_size = elementSize;
    desc.unauthored_index = -1;
    std::vector<double> times;
    std::vector<void const*> values;
    std::vector<size_t> counts;
    bool const isOfPoints =
        interpolation == HdInterpolationVertex || interpolation == HdInterpolationVarying;
    HdTrapezeSelection const selection = isOfPoints && !indices.empty()
                                             ? HdTrapezeSelection(samples, indices, 0, elementSize)
                                             : HdTrapezeSelection();
    if (!selection.times.empty()) {
        desc.type = selection.type;
        desc.width = selection.width;
        times = selection.times;
        values = selection.values;
        counts = selection.counts;
    } else {
        _View(samples, &desc, &times, &values, &counts);
    }
    if (values.empty()) {
        return false;
    }
    desc.times = times.data();
    desc.sample_count = times.size();
    desc.values = values.data();
    desc.value_counts = counts.data();
    return param.Edit(trz_prim_set_primvar(param.Session(), prim, name.GetText(), &desc), id);
}

} // namespace

uint32_t HdTrapezeInterpolation(HdInterpolation interpolation) {
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

bool HdTrapezePrimvars::IsNeeded(TfToken const& name) {
    return name == HdTokens->displayColor || name == HdTokens->displayOpacity ||
           name == HdTokens->widths || name == HdTokens->normals;
}

int HdTrapezePrimvars::ElementSize(HdPrimvarDescriptor const& primvar) {
    return _ElementSize(primvar, 0);
}

void HdTrapezePrimvars::Sync(SdfPath const& id, trz_id prim, VtIntArray const& indices,
                             HdSceneDelegate* delegate, HdTrapezeRenderParam& param) {
    GfInterval const shutter = param.Shutter();
    std::set<TfToken> const wanted = param.WantedPrimvars();
    std::set<TfToken> sent;
    auto const isWanted = [&](TfToken const& name) { return IsNeeded(name) || wanted.count(name); };
    for (int i = 0; i < HdInterpolationCount; ++i) {
        auto const interpolation = static_cast<HdInterpolation>(i);
        if (interpolation == HdInterpolationInstance) {
            continue; // an instancer's own: HdTrapezeInstancer
        }
        for (auto const& computed :
             delegate->GetExtComputationPrimvarDescriptors(id, interpolation)) {
            if (isWanted(computed.name)) {
                auto const samples = HdTrapezeSampleComputed(delegate, computed, shutter);
                if (_Send(id, prim, computed.name, interpolation, computed.role, 1, samples,
                          indices, param)) {
                    sent.insert(computed.name);
                }
            }
        }
        for (auto const& primvar : delegate->GetPrimvarDescriptors(id, interpolation)) {
            if (isWanted(primvar.name) && !sent.count(primvar.name)) {
                auto const samples = HdTrapezeSamplePrimvar(delegate, id, primvar.name, shutter);
                if (_Send(id, prim, primvar.name, interpolation, primvar.role, ElementSize(primvar),
                          samples, indices, param)) {
                    sent.insert(primvar.name);
                }
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
