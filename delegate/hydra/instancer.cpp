#include "instancer.h"

#include "numbers.h"
#include "schema.h"

#include "pxr/base/gf/quatd.h"
#include "pxr/base/gf/quath.h"
#include "pxr/base/gf/traits.h"
#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/imaging/hd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

TF_DEFINE_PRIVATE_TOKENS(_tokens, (angularVelocities));

// Quaternions as floats. Older hosts give vectors that have the real part first.
template <class T> bool _MakeQuaternions(VtValue* value) {
    if (!value->IsHolding<VtArray<T>>()) {
        return false;
    }
    VtQuatfArray quaternions;
    for (T const& from : value->UncheckedGet<VtArray<T>>()) {
        if constexpr (GfIsGfQuat<T>::value) {
            quaternions.push_back(GfQuatf(from));
        } else {
            quaternions.push_back(GfQuatf(from[0], from[1], from[2], from[3]));
        }
    }
    *value = quaternions;
    return true;
}

// Instances that are prims of their own may move though hosts give their matrices at the frame
// alone: then those of the prims, where they are the same at the frame. True where there are any.
bool _AddMotion(HdSceneDelegate* delegate, SdfPath const& id, GfInterval const& shutter,
                HdTrapezeSamples<VtValue>* matrices) {
    static HdDataSourceLocator const topology(TfToken("instancerTopology"));
    if (matrices->values.size() != 1 || shutter.GetSize() == 0.0 ||
        !matrices->values[0].IsHolding<VtMatrix4dArray>()) {
        return false;
    }
    auto const& frame = matrices->values[0].UncheckedGet<VtMatrix4dArray>();
    auto const prims = HdTrapezeSchema(delegate, id, topology)
                           .Get(TfToken("instanceLocations"), VtArray<SdfPath>());
    if (prims.size() != frame.size()) {
        return false;
    }
    std::vector<HdTrapezeTransform> tracks;
    for (size_t i = 0; i < prims.size(); ++i) {
        if (!GfIsClose(delegate->GetTransform(prims[i]), frame[i], 1e-6)) {
            return false;
        }
        tracks.push_back(HdTrapezeSampleTransform(delegate, prims[i], shutter));
    }
    HdTrapezeSamples<VtValue> moving{HdTrapezeTimes(tracks), {}};
    if (moving.times.empty()) {
        return false;
    }
    for (double time : moving.times) {
        VtMatrix4dArray values(frame.size());
        for (size_t i = 0; i < frame.size(); ++i) {
            values[i] = HdTrapezeAt(tracks[i], time, frame[i]);
        }
        moving.values.emplace_back(std::move(values));
    }
    *matrices = std::move(moving);
    return true;
}

// Lists of instances are mostly shared by those that have the same: hosts copy them for every part.
struct _Less {
    bool operator()(VtIntArray const& a, VtIntArray const& b) const {
        return !a.IsIdentical(b) &&
               std::lexicographical_compare(a.cbegin(), a.cend(), b.cbegin(), b.cend());
    }
};

} // namespace

bool HdTrapezeInstancer::IsPlace(TfToken const& name) {
    TfTokenVector const& names = GetBuiltinPrimvarNames();
    return std::find(names.begin(), names.end(), name) != names.end() ||
           name == HdTokens->velocities || name == HdTokens->accelerations ||
           name == _tokens->angularVelocities;
}

void HdTrapezeInstancer::Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
                              HdDirtyBits* dirtyBits) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    // What failed may have changed it in part.
    HdDirtyBits const bits = _lost ? HdChangeTracker::AllDirty : *dirtyBits;
    bool const lost = !param.Guard(GetId(), [&] { _Sync(delegate, param, bits); });
    if (_lost != lost) {
        _lost = lost;
        param.Edit(GetId(), trz_prim_set_visible, _id, !lost);
    }
    // Whether instances are visible is told with their prims, and in lists of instances.
    *dirtyBits &= ~HdChangeTracker::AllSceneDirtyBits;
}

void HdTrapezeInstancer::_Sync(HdSceneDelegate* delegate, HdTrapezeRenderParam& param,
                               HdDirtyBits bits) {
    SdfPath const& id = GetId();
    if (_id == 0) {
        if (!param.Edit(id, trz_instancer_create, id.GetText(), &_id)) {
            return;
        }
        param.instancers.Add(id, this);
        bits = HdChangeTracker::AllDirty;
    }
    HdTrapezeSyncing instancer{id, _id, delegate, param, _motion.Reach(param.Shutter())};
    SdfPath const before = GetParentId();
    _UpdateInstancer(delegate, &bits);
    SdfPath const& parent = GetParentId();
    if (before != parent) {
        if (HdTrapezeInstancer* nest = param.instancers.Find(before)) {
            nest->RemovePart(id);
        }
        instancer.Edit(trz_prim_set_instancer, 0, 0);
    }
    if (bits & (HdChangeTracker::DirtyInstanceIndex | HdChangeTracker::DirtyInstancer)) {
        // Parents are synced after their children.
        auto* const nest =
            static_cast<HdTrapezeInstancer*>(delegate->GetRenderIndex().GetInstancer(parent));
        if (nest) {
            nest->SetPart(id, _id, delegate->GetInstanceIndices(parent, id));
        }
    }
    if (bits & HdChangeTracker::DirtyPrimvar) {
        instancer.SendMotion(&_motion);
        instancer.shutter = _motion.Reach(param.Shutter());
        _SyncPlaces(instancer);
        _primvars.Sync(instancer, HdTrapezePrimvars::Of::Instances);
    }
    if (bits & HdChangeTracker::DirtyTransform) {
        instancer.SendTransform(HdTrapezeSampleTransform(delegate, id, instancer.shutter, true));
    }
}

void HdTrapezeInstancer::_SyncPlaces(HdTrapezeSyncing const& instancer) {
    auto const& [id, handle, delegate, param, shutter, type] = instancer;
    _places.clear();
    for (auto const& primvar : delegate->GetPrimvarDescriptors(id, HdInterpolationInstance)) {
        if (IsPlace(primvar.name)) {
            _places[primvar.name] = HdTrapezeSamplePrimvar(delegate, id, primvar.name, shutter);
        }
    }
    auto const matrices = _places.find(HdInstancerTokens->instanceTransforms);
    if (matrices != _places.end()) {
        bool const evaluated = _AddMotion(delegate, id, shutter, &matrices->second);
        bool const framed = HdTrapezeAddFrame(&matrices->second, [&] {
            return delegate->Get(id, HdInstancerTokens->instanceTransforms);
        });
        // What is evaluated has the frames of its prims among its samples.
        _matricesTurn = evaluated ? 2 : framed ? 3 : 1;
    }
    for (VtValue& value : _places[HdInstancerTokens->instanceRotations].values) {
        _MakeQuaternions<GfQuath>(&value) || _MakeQuaternions<GfQuatd>(&value) ||
            _MakeQuaternions<GfVec4f>(&value) || _MakeQuaternions<GfVec4d>(&value);
    }
    _placesChanged = true;
}

void HdTrapezeInstancer::Finalize(HdRenderParam* renderParam) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    SdfPath const& id = GetId();
    param.instancers.Remove(id);
    if (HdTrapezeInstancer* parent = param.instancers.Find(GetParentId())) {
        parent->RemovePart(id);
    }
    if (_id != 0) {
        param.Edit(id, trz_prim_remove, _id);
        _id = 0;
    }
    HdInstancer::Finalize(renderParam);
}

void HdTrapezeInstancer::SetPart(SdfPath const& id, trz_id part, VtIntArray const& instances) {
    std::lock_guard<std::mutex> lock(_mutex);
    _Part& known = _parts[id];
    if (known.id != part) {
        known = {{}, part};
    }
    known.instances = instances;
    _partsChanged = true;
}

void HdTrapezeInstancer::RemovePart(SdfPath const& id) {
    std::lock_guard<std::mutex> lock(_mutex);
    _partsChanged |= _parts.erase(id) > 0;
}

void HdTrapezeInstancer::Commit(HdTrapezeRenderParam& param) {
    if (_partsChanged) {
        std::map<VtIntArray, size_t, _Less> numbers;
        std::vector<VtIntArray> lists;
        for (auto& [id, part] : _parts) {
            auto const [number, isNew] = numbers.emplace(part.instances, lists.size());
            if (isNew) {
                lists.push_back(part.instances);
            }
            part.instances = number->first; // one of each is kept
            if (part.prototype != number->second) {
                part.prototype = number->second;
                param.Edit(GetId(), trz_prim_set_instancer, part.id, _id,
                           static_cast<uint32_t>(part.prototype));
            }
        }
        _placesChanged |= lists != _lists;
        _lists = std::move(lists);
    }
    if (_placesChanged) {
        _SendPlaces(param);
    }
    _partsChanged = _placesChanged = false;
}

void HdTrapezeInstancer::_SendPlaces(HdTrapezeRenderParam& param) {
    using Vectors = HdTrapezeArrays<GfVec3f, float>;
    Vectors const positions(_places[HdInstancerTokens->instanceTranslations]);
    HdTrapezeArrays<GfQuatf, float> const orientations(
        _places[HdInstancerTokens->instanceRotations]);
    Vectors const scales(_places[HdInstancerTokens->instanceScales]);
    Vectors const velocities(_places[HdTokens->velocities]);
    Vectors const accelerations(_places[HdTokens->accelerations]);
    Vectors const turns(_places[_tokens->angularVelocities]);
    HdTrapezeArrays<GfMatrix4d, double> const matrices(
        _places[HdInstancerTokens->instanceTransforms]);
    std::vector<int const*> lists;
    std::vector<size_t> lengths;
    for (VtIntArray const& list : _lists) {
        lists.push_back(list.cdata());
        lengths.push_back(list.size());
    }
    auto desc = HdTrapezeStruct<trz_instancer>();
    desc.prototype_count = lists.size();
    desc.lists = lists.data();
    desc.list_counts = lengths.data();
    desc.positions = positions.View<trz_float_samples>();
    desc.orientations = orientations.View<trz_float_samples>();
    desc.scales = scales.View<trz_float_samples>();
    desc.velocities = velocities.View<trz_float_samples>();
    desc.accelerations = accelerations.View<trz_float_samples>();
    desc.angular_velocities = turns.View<trz_float_samples>();
    desc.matrices = matrices.View<trz_matrix_samples>();
    desc.matrices_turn = _matricesTurn;
    if (!velocities.IsEmpty() || !accelerations.IsEmpty() || !turns.IsEmpty()) {
        desc.time_codes_per_second = param.TimeCodesPerSecond();
    }
    param.Edit(GetId(), trz_instancer_set, _id, &desc);
}

PXR_NAMESPACE_CLOSE_SCOPE
