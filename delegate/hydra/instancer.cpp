#include "instancer.h"

#include "numbers.h"
#include "schema.h"

#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/imaging/hd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

TF_DEFINE_PRIVATE_TOKENS(_tokens, (angularVelocities));

// Older hosts give rotations as vectors that have the real part first.
template <class Vector> void _MakeQuaternions(VtValue* value) {
    if (value->IsHolding<VtArray<Vector>>()) {
        VtQuatfArray quaternions;
        for (Vector const& v : value->UncheckedGet<VtArray<Vector>>()) {
            quaternions.push_back(GfQuatf(v[0], v[1], v[2], v[3]));
        }
        *value = quaternions;
    }
}

// Turning instances do not go through the frame's own matrices on the line between the samples
// around it: then those are a sample more. True where all go straight there.
bool _AddFrame(HdSceneDelegate* delegate, SdfPath const& id, HdTrapezeSamples<VtValue>* matrices) {
    auto& [times, values] = *matrices;
    size_t const slot = HdTrapezeFrameSlot(times);
    if (slot == 0) {
        return false;
    }
    VtValue const value = delegate->Get(id, HdInstancerTokens->instanceTransforms);
    auto const now = value.GetWithDefault<VtMatrix4dArray>();
    auto const first = values[slot - 1].GetWithDefault<VtMatrix4dArray>();
    auto const last = values[slot].GetWithDefault<VtMatrix4dArray>();
    if (now.size() != first.size() || now.size() != last.size()) {
        return false;
    }
    double const part = -times[slot - 1] / (times[slot] - times[slot - 1]);
    for (size_t i = 0; i < now.size(); ++i) {
        if (!HdTrapezeIsSame(first[i] + part * (last[i] - first[i]), now[i])) {
            times.insert(times.begin() + slot, 0.0);
            values.insert(values.begin() + slot, value);
            return false;
        }
    }
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
    std::set<double> times;
    for (size_t i = 0; i < prims.size(); ++i) {
        if (!GfIsClose(delegate->GetTransform(prims[i]), frame[i], 1e-6)) {
            return false;
        }
        tracks.push_back(HdTrapezeSampleTransform(delegate, prims[i], shutter));
        if (tracks[i].times.size() > 1) {
            times.insert(tracks[i].times.begin(), tracks[i].times.end());
        }
    }
    if (times.empty()) {
        return false;
    }
    HdTrapezeSamples<VtValue> moving;
    for (double time : times) {
        VtMatrix4dArray values(frame.size());
        for (size_t i = 0; i < frame.size(); ++i) {
            values[i] = HdTrapezeAt(tracks[i], time, frame[i]);
        }
        moving.times.push_back(time);
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
    SdfPath const& id = GetId();
    HdDirtyBits const bits = *dirtyBits;
    bool const created = _id == 0;
    if (created) {
        if (!param.Session() ||
            !param.Edit(trz_instancer_create(param.Session(), id.GetText(), &_id), id)) {
            return;
        }
        param.instancers.Add(id, this);
    }
    SdfPath const before = GetParentId();
    _UpdateInstancer(delegate, dirtyBits);
    SdfPath const& parent = GetParentId();
    if (before != parent) {
        if (HdTrapezeInstancer* instancer = param.instancers.Find(before)) {
            instancer->RemovePart(id);
        }
        param.Edit(trz_prim_set_instancer(param.Session(), _id, 0, 0), id);
    }
    if (!parent.IsEmpty() && (created || HdChangeTracker::IsInstanceIndexDirty(bits, id) ||
                              HdChangeTracker::IsInstancerDirty(bits, id))) {
        // Parents are synced after their children.
        auto* const instancer =
            static_cast<HdTrapezeInstancer*>(delegate->GetRenderIndex().GetInstancer(parent));
        if (instancer) {
            instancer->SetPart(id, _id, delegate->GetInstanceIndices(parent, id));
        }
    }
    GfInterval const shutter = param.Shutter();
    if (created || HdChangeTracker::IsTransformDirty(bits, id)) {
        param.SetTransform(_id, HdTrapezeSampleInstancerTransform(delegate, id, shutter), id);
    }
    if (created || (bits & HdChangeTracker::DirtyPrimvar)) {
        HdTrapezeMotion const motion(id, delegate);
        if (motion != _motion) {
            _motion = motion;
            motion.Send(id, _id, param);
        }
        _places.clear();
        for (auto const& primvar : delegate->GetPrimvarDescriptors(id, HdInterpolationInstance)) {
            if (IsPlace(primvar.name)) {
                _places[primvar.name] = HdTrapezeSamplePrimvar(delegate, id, primvar.name, shutter);
            }
        }
        auto const matrices = _places.find(HdInstancerTokens->instanceTransforms);
        if (matrices != _places.end()) {
            bool const evaluated = _AddMotion(delegate, id, shutter, &matrices->second);
            bool const straight = _AddFrame(delegate, id, &matrices->second);
            _matricesTurn = !evaluated && !straight;
        }
        for (VtValue& value : _places[HdInstancerTokens->instanceRotations].values) {
            _MakeQuaternions<GfVec4f>(&value);
            _MakeQuaternions<GfVec4d>(&value);
        }
        _placesChanged = true;
        _primvars.Sync(HdTrapezePrimvars::Of::Instances, id, _id, {}, delegate, param);
    }
    // Whether instances are visible is told with their prims, and in lists of instances.
    *dirtyBits &= ~HdChangeTracker::AllSceneDirtyBits;
}

void HdTrapezeInstancer::Finalize(HdRenderParam* renderParam) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    SdfPath const& id = GetId();
    param.instancers.Remove(id);
    if (HdTrapezeInstancer* parent = param.instancers.Find(GetParentId())) {
        parent->RemovePart(id);
    }
    if (_id != 0) {
        param.Edit(trz_prim_remove(param.Session(), _id), id);
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
                param.Edit(trz_prim_set_instancer(param.Session(), part.id, _id,
                                                  static_cast<uint32_t>(part.prototype)),
                           GetId());
            }
        }
        _placesChanged |= lists != _lists;
        _lists = std::move(lists);
    }
    if (_placesChanged) {
        _SetValues(param);
    }
    _partsChanged = _placesChanged = false;
}

void HdTrapezeInstancer::_SetValues(HdTrapezeRenderParam& param) {
    auto const floats = [&](TfToken const& name, uint32_t width) {
        return HdTrapezeFloatSamples(_places[name], width);
    };
    auto const positions = floats(HdInstancerTokens->instanceTranslations, 3);
    auto const orientations = floats(HdInstancerTokens->instanceRotations, 4);
    auto const scales = floats(HdInstancerTokens->instanceScales, 3);
    auto const velocities = floats(HdTokens->velocities, 3);
    auto const accelerations = floats(HdTokens->accelerations, 3);
    auto const turns = floats(_tokens->angularVelocities, 3);
    auto const& matrices = _places[HdInstancerTokens->instanceTransforms];
    std::vector<double const*> matrixValues;
    std::vector<size_t> matrixCounts;
    for (VtValue const& value : matrices.values) {
        auto const array = value.GetWithDefault<VtMatrix4dArray>(); // shares the value's numbers
        matrixValues.push_back(array.empty() ? nullptr : array.cdata()->data());
        matrixCounts.push_back(array.size());
    }
    std::vector<int const*> lists;
    std::vector<size_t> lengths;
    for (VtIntArray const& list : _lists) {
        lists.push_back(list.cdata());
        lengths.push_back(list.size());
    }
    trz_instancer desc = {};
    desc.struct_size = sizeof(desc);
    desc.prototype_count = lists.size();
    desc.lists = lists.data();
    desc.list_counts = lengths.data();
    desc.positions = positions.View();
    desc.orientations = orientations.View();
    desc.scales = scales.View();
    desc.velocities = velocities.View();
    desc.accelerations = accelerations.View();
    desc.angular_velocities = turns.View();
    desc.matrices = {matrices.times.data(), matrices.times.size(), matrixValues.data(),
                     matrixCounts.data()};
    desc.matrices_turn = _matricesTurn;
    if (!velocities.IsEmpty() || !accelerations.IsEmpty() || !turns.IsEmpty()) {
        desc.time_codes_per_second = param.TimeCodesPerSecond();
    }
    param.Edit(trz_instancer_set(param.Session(), _id, &desc), GetId());
}

PXR_NAMESPACE_CLOSE_SCOPE
