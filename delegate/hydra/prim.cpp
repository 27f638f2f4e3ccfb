#include "prim.h"

#include "instancer.h"
#include "numbers.h"
#include "samples.h"

#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/imaging/hd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Of a computed primvar, its description.
bool _FindComputed(HdSceneDelegate* delegate, SdfPath const& id, TfToken const& name,
                   HdExtComputationPrimvarDescriptor* out) {
    for (auto const& descriptor :
         delegate->GetExtComputationPrimvarDescriptors(id, HdInterpolationVertex)) {
        if (descriptor.name == name) {
            *out = descriptor;
            return true;
        }
    }
    return false;
}

} // namespace

HdTrapezeMotion::HdTrapezeMotion(SdfPath const& id, HdSceneDelegate* delegate) {
    VtValue const blur = delegate->Get(id, HdTokens->blurScale);
    if (blur.IsHolding<float>()) {
        blurScale = blur.UncheckedGet<float>();
    } else if (blur.IsHolding<double>()) {
        blurScale = blur.UncheckedGet<double>();
    }
    // Some hosts have USD's fallback, 3, where nothing is authored; as many as needed are better.
    auto const constants = delegate->GetPrimvarDescriptors(id, HdInterpolationConstant);
    bool const listed =
        std::any_of(constants.begin(), constants.end(), [](HdPrimvarDescriptor const& primvar) {
            return primvar.name == HdTokens->nonlinearSampleCount;
        });
    int const given = delegate->Get(id, HdTokens->nonlinearSampleCount).GetWithDefault<int>(0);
    sampleCount = given <= 0 || (given == 3 && !listed) ? 0 : static_cast<uint32_t>(given);
}

void HdTrapezeMotion::Send(SdfPath const& id, trz_id prim, HdTrapezeRenderParam& param) const {
    param.Edit(trz_prim_set_motion(param.Session(), prim, blurScale, sampleCount), id);
}

bool HdTrapezePrim::Sync(HdRprim const& rprim, HdSceneDelegate* delegate,
                         HdTrapezeRenderParam& param, HdDirtyBits bits) {
    SdfPath const& id = rprim.GetId();
    bool const created = _id == 0;
    if (created) {
        if (!_create || !param.Session() ||
            !param.Edit(_create(param.Session(), id.GetText(), &_id), id)) {
            return false;
        }
        param.prims.Add(id, this);
        param.MarkVisibilityDirty();
        SetRenderTag(rprim.GetRenderTag());
    }
    if (created || (bits & HdChangeTracker::DirtyPrimID)) {
        param.Edit(trz_prim_set_pick_id(param.Session(), _id, rprim.GetPrimId()), id);
    }
    bool const primvars = created || (bits & HdChangeTracker::DirtyPrimvar);
    if (primvars) {
        HdTrapezeMotion const motion(id, delegate);
        // Samples are needed around the scaled shutter, too.
        _reach = motion.blurScale > 1.0 ? motion.blurScale : 1.0;
        motion.Send(id, _id, param);
    }
    if (created || HdChangeTracker::IsTransformDirty(bits, id)) {
        _SyncTransform(id, delegate, param);
    }
    if (created || HdChangeTracker::IsInstancerDirty(bits, id) ||
        HdChangeTracker::IsInstanceIndexDirty(bits, id)) {
        _SyncInstancer(rprim, delegate, param);
    }
    if (created || (bits & HdChangeTracker::DirtyDoubleSided)) {
        bool const sides = delegate->GetDoubleSided(id);
        param.Edit(trz_prim_set_double_sided(param.Session(), _id, sides), id);
    }
    if (created || (bits & HdChangeTracker::DirtyVisibility)) {
        _visible = rprim.IsVisible();
        param.MarkVisibilityDirty();
    }
    if (created || HdChangeTracker::IsDisplayStyleDirty(bits, id)) {
        _refineLevel = delegate->GetDisplayStyle(id).refineLevel;
        param.MarkVisibilityDirty();
    }
    if (_points == Points::Yes && (primvars || (bits & HdChangeTracker::DirtyPoints))) {
        _SyncPoints(id, delegate, param);
    }
    if (primvars || (bits & (HdChangeTracker::DirtyNormals | HdChangeTracker::DirtyWidths))) {
        _primvars.Sync(HdTrapezePrimvars::Of::Prim, id, _id, _indices, delegate, param);
    }
    return true;
}

void HdTrapezePrim::Finalize(HdRprim const& rprim, HdTrapezeRenderParam& param) {
    if (_id == 0) {
        return;
    }
    SdfPath const& id = rprim.GetId();
    param.prims.Remove(id);
    if (HdTrapezeInstancer* instancer = param.instancers.Find(_instancer)) {
        instancer->RemovePart(id);
    }
    param.Edit(trz_prim_remove(param.Session(), _id), id);
    _id = 0;
}

void HdTrapezePrim::Include(SdfPath const& id, bool included, HdTrapezeRenderParam& param) {
    bool const shown = included && _visible && !_lost;
    if (shown != _shown) {
        _shown = shown;
        param.Edit(trz_prim_set_visible(param.Session(), _id, shown), id);
    }
}

void HdTrapezePrim::_SyncTransform(SdfPath const& id, HdSceneDelegate* delegate,
                                   HdTrapezeRenderParam& param) {
    auto const samples = HdTrapezeSampleTransform(delegate, id, Shutter(param));
    auto const moves = [&](GfMatrix4d const& m) { return m != samples.values.front(); };
    if (_reach > 1.0 && std::any_of(samples.values.begin(), samples.values.end(), moves) &&
        HdTrapezeRenderParam::IsOfDelegate(delegate->GetRenderIndex(), id)) {
        param.WarnOnce(id,
                       "its motion:blurScale is above 1, but this host samples transforms for its "
                       "camera's shutter alone: outside of it they stand still");
    }
    param.SetTransform(_id, samples, id);
}

void HdTrapezePrim::_SyncPoints(SdfPath const& id, HdSceneDelegate* delegate,
                                HdTrapezeRenderParam& param) {
    GfInterval const shutter = Shutter(param);
    HdExtComputationPrimvarDescriptor computed;
    bool const isComputed = _FindComputed(delegate, id, HdTokens->points, &computed);
    auto const points = isComputed
                            ? HdTrapezeSampleComputed(delegate, computed, shutter)
                            : HdTrapezeSamplePrimvar(delegate, id, HdTokens->points, shutter);
    HdTrapezeSamples<VtValue> velocities;
    HdTrapezeSamples<VtValue> accelerations;
    if (!isComputed) {
        velocities = HdTrapezeSamplePrimvar(delegate, id, HdTokens->velocities, shutter);
        if (!velocities.values.empty()) {
            accelerations = HdTrapezeSamplePrimvar(delegate, id, HdTokens->accelerations, shutter);
        }
    }
    HdTrapezeFloatSamples const p(points, 3, _indices);
    HdTrapezeFloatSamples const v(velocities, 3, _indices);
    HdTrapezeFloatSamples const a(accelerations, 3, _indices);
    trz_float_samples const view = p.View();
    trz_points desc = {};
    desc.struct_size = sizeof(desc);
    desc.times = view.times;
    desc.sample_count = view.sample_count;
    desc.points = view.values;
    desc.counts = view.counts;
    desc.velocities = v.View();
    desc.accelerations = a.View();
    if (!v.IsEmpty() || !a.IsEmpty()) {
        desc.time_codes_per_second = param.TimeCodesPerSecond();
    }
    param.Edit(trz_prim_set_points(param.Session(), _id, &desc), id);
}

void HdTrapezePrim::_SyncInstancer(HdRprim const& rprim, HdSceneDelegate* delegate,
                                   HdTrapezeRenderParam& param) {
    SdfPath const& id = rprim.GetId();
    SdfPath const& now = rprim.GetInstancerId();
    if (_instancer != now) {
        if (HdTrapezeInstancer* before = param.instancers.Find(_instancer)) {
            before->RemovePart(id);
        }
        if (now.IsEmpty()) {
            param.Edit(trz_prim_set_instancer(param.Session(), _id, 0, 0), id);
        }
        _instancer = now;
    }
    HdTrapezeInstancer* const instancer = param.instancers.Find(now);
    if (instancer) {
        instancer->SetPart(id, _id, delegate->GetInstanceIndices(now, id));
    }
    bool const lost = !now.IsEmpty() && !instancer;
    if (lost && !_lost) {
        TF_WARN("Trapeze <%s>: its instancer <%s> is not there; it has no instances", id.GetText(),
                now.GetText());
    }
    _lost = lost;
    param.MarkVisibilityDirty();
}

PXR_NAMESPACE_CLOSE_SCOPE
