#include "rprim.h"

#include "instancer.h"
#include "numbers.h"

#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/imaging/hd/tokens.h"

#include <algorithm>

PXR_NAMESPACE_OPEN_SCOPE

HdDirtyBits HdTrapezeRprim::GetInitialDirtyBitsMask() const {
    return HdChangeTracker::AllSceneDirtyBits | HdChangeTracker::InitRepr;
}

TfTokenVector const& HdTrapezeRprim::GetBuiltinPrimvarNames() const {
    static TfTokenVector const none;
    return none;
}

// Every way of drawing a prim is the same here.
void HdTrapezeRprim::_InitRepr(TfToken const& name, HdDirtyBits*) {
    if (std::none_of(_reprs.begin(), _reprs.end(), _ReprComparator(name))) {
        _reprs.emplace_back(name, HdReprSharedPtr());
    }
}

void HdTrapezeRprim::Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
                          HdDirtyBits* dirtyBits, TfToken const&) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    bool const before = _lost;
    // What failed may have changed it in part.
    HdDirtyBits const bits = _lost ? HdChangeTracker::AllDirty : *dirtyBits;
    if (!param.Guard(GetId(), [&] { _Sync(delegate, param, bits); })) {
        _lost = true;
    }
    if (_lost != before) {
        param.MarkVisibilityDirty();
    }
    *dirtyBits &= ~HdChangeTracker::AllSceneDirtyBits;
}

void HdTrapezeRprim::_Sync(HdSceneDelegate* delegate, HdTrapezeRenderParam& param,
                           HdDirtyBits bits) {
    _UpdateVisibility(delegate, &bits);
    _UpdateInstancer(delegate, &bits);
    HdRenderIndex& index = delegate->GetRenderIndex();
    if (index.GetInstancer(GetInstancerId())) {
        HdInstancer::_SyncInstancerAndParents(index, GetInstancerId());
    }
    SdfPath const& id = GetId();
    if (_id == 0) {
        if (!_shape.create || !param.Edit(id, _shape.create, id.GetText(), &_id)) {
            return;
        }
        param.prims.Add(id, this);
        bits = HdChangeTracker::AllDirty;
    }
    if (bits & (HdChangeTracker::DirtyVisibility | HdChangeTracker::DirtyDisplayStyle)) {
        param.MarkVisibilityDirty();
    }
    bool const primvars = bits & HdChangeTracker::DirtyPrimvar;
    HdTrapezeSyncing prim{id, _id, delegate, param, {}, _shape.type};
    if (primvars) {
        prim.SendMotion(&_motion);
    }
    prim.shutter = _motion.Reach(param.Shutter());
    if (bits & HdChangeTracker::DirtyPrimID) {
        prim.Edit(trz_prim_set_pick_id, GetPrimId());
    }
    if (bits & HdChangeTracker::DirtyTransform) {
        _SyncTransform(prim);
    }
    if (bits & (HdChangeTracker::DirtyInstancer | HdChangeTracker::DirtyInstanceIndex)) {
        _SyncInstancer(prim);
    }
    if (bits & HdChangeTracker::DirtyDoubleSided) {
        prim.Edit(trz_prim_set_double_sided, delegate->GetDoubleSided(id));
    }
    if (bits & HdChangeTracker::DirtyDisplayStyle) {
        _refineLevel = delegate->GetDisplayStyle(id).refineLevel;
    }
    bool const reordered = (bits & HdChangeTracker::DirtyTopology) && _SyncIndices(prim);
    if (_shape.hasPoints && (primvars || reordered || (bits & HdChangeTracker::DirtyPoints))) {
        _SyncPoints(prim);
    }
    if (primvars || reordered ||
        (bits & (HdChangeTracker::DirtyNormals | HdChangeTracker::DirtyWidths))) {
        _primvars.Sync(prim, HdTrapezePrimvars::Of::Prim, _indices);
    }
    if (_shape.send && (bits & _shape.bits)) {
        _shape.send(prim);
    }
}

// Apart from Sync: prims whose tag is not asked for, or no longer, are not synced.
void HdTrapezeRprim::UpdateRenderTag(HdSceneDelegate* delegate, HdRenderParam* renderParam) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    param.Guard(GetId(), [&] { HdRprim::UpdateRenderTag(delegate, renderParam); });
    param.MarkVisibilityDirty();
}

void HdTrapezeRprim::Finalize(HdRenderParam* renderParam) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    if (_id != 0) {
        param.prims.Remove(GetId());
        if (HdTrapezeInstancer* instancer = param.instancers.Find(_instancer)) {
            instancer->RemovePart(GetId());
        }
        param.Edit(GetId(), trz_prim_remove, _id);
        _id = 0;
    }
    HdRprim::Finalize(renderParam);
}

void HdTrapezeRprim::Include(bool included, HdTrapezeRenderParam& param) {
    bool const shown = included && IsVisible() && !_lost;
    if (shown != _shown) {
        _shown = shown;
        param.Edit(GetId(), trz_prim_set_visible, _id, shown);
    }
}

void HdTrapezeRprim::_SyncTransform(HdTrapezeSyncing const& prim) {
    auto const samples = HdTrapezeSampleTransform(prim.delegate, prim.id, prim.shutter);
    auto const moves = [&](GfMatrix4d const& m) { return m != samples.values.front(); };
    if (_motion.blurScale > 1.0 &&
        std::any_of(samples.values.begin(), samples.values.end(), moves) &&
        HdTrapezeRenderParam::IsOfDelegate(prim.delegate->GetRenderIndex(), prim.id)) {
        prim.param.WarnOnce(
            prim.id, "its motion:blurScale is above 1, but this host samples transforms for its "
                     "camera's shutter alone: outside of it they stand still");
    }
    prim.SendTransform(samples);
}

// True where vertices are other points than before.
bool HdTrapezeRprim::_SyncIndices(HdTrapezeSyncing const& prim) {
    VtIntArray const before = _indices;
    if (_shape.indices) {
        _indices = _shape.indices(prim.delegate, prim.id);
    }
    return _indices != before;
}

void HdTrapezeRprim::_SyncPoints(HdTrapezeSyncing const& prim) {
    auto const sample = [&](TfToken const& name) {
        return HdTrapezeSamplePrimvar(prim.delegate, prim.id, name, prim.shutter);
    };
    using Arrays = HdTrapezeArrays<GfVec3f, float>;
    Arrays velocities, accelerations;
    HdTrapezeSamples<VtValue> points;
    auto const computed =
        prim.delegate->GetExtComputationPrimvarDescriptors(prim.id, HdInterpolationVertex);
    auto const isPoints = [](auto const& primvar) { return primvar.name == HdTokens->points; };
    auto const found = std::find_if(computed.begin(), computed.end(), isPoints);
    if (found != computed.end()) {
        points = HdTrapezeSampleComputed(prim.delegate, *found, prim.shutter);
    } else {
        points = sample(HdTokens->points);
        velocities = Arrays(sample(HdTokens->velocities), _indices);
        if (!velocities.IsEmpty()) {
            accelerations = Arrays(sample(HdTokens->accelerations), _indices);
        }
    }
    Arrays const arrays(points, _indices);
    auto const view = arrays.View<trz_float_samples>();
    auto desc = HdTrapezeStruct<trz_points>();
    desc.times = view.times;
    desc.sample_count = view.sample_count;
    desc.points = view.values;
    desc.counts = view.counts;
    desc.velocities = velocities.View<trz_float_samples>();
    desc.accelerations = accelerations.View<trz_float_samples>();
    if (!velocities.IsEmpty()) {
        desc.time_codes_per_second = prim.param.TimeCodesPerSecond();
    }
    prim.Edit(trz_prim_set_points, &desc);
}

void HdTrapezeRprim::_SyncInstancer(HdTrapezeSyncing const& prim) {
    SdfPath const& now = GetInstancerId();
    if (_instancer != now) {
        if (HdTrapezeInstancer* before = prim.param.instancers.Find(_instancer)) {
            before->RemovePart(prim.id);
        }
        if (now.IsEmpty()) {
            prim.Edit(trz_prim_set_instancer, 0, 0);
        }
        _instancer = now;
    }
    HdTrapezeInstancer* const instancer = prim.param.instancers.Find(now);
    if (instancer) {
        instancer->SetPart(prim.id, _id, prim.delegate->GetInstanceIndices(now, prim.id));
    }
    _lost = !now.IsEmpty() && !instancer;
    if (_lost) {
        prim.param.WarnOnce(prim.id, "its instancer <" + now.GetString() +
                                         "> is not there; it has no instances");
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
