#include "instancer.h"

#include "primvars.h"
#include "schema.h"
#include "selection.h"

#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/imaging/hd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

TF_DEFINE_PRIVATE_TOKENS(_tokens, (angularVelocities));

// Floats at several times, as the C ABI takes them.
struct _FloatSamples {
    std::vector<std::vector<float>> floats;
    std::vector<double> times;
    std::vector<size_t> counts;
    std::vector<float const*> values;

    _FloatSamples() = default;
    _FloatSamples(HdTrapezeSamples<VtValue> const& samples, VtIntArray const& instances,
                  uint32_t width, std::vector<int> const& order = {}) {
        HdTrapezeSelection const selection(samples, instances, width);
        times = selection.times;
        counts = selection.counts;
        floats = selection.Floats(order);
        for (auto const& array : floats) {
            values.push_back(array.data());
        }
    }

    trz_float_samples View() const {
        return {times.data(), times.size(), values.data(), counts.data()};
    }
};

// Rotations as quaternions x, y, z, w. Arrays of GfVec4f, which older hosts give, have the real
// part first.
_FloatSamples _Rotations(HdTrapezeSamples<VtValue> const& samples, VtIntArray const& instances) {
    bool const realFirst =
        !samples.values.empty() && (samples.values.front().IsHolding<VtArray<GfVec4f>>() ||
                                    samples.values.front().IsHolding<VtArray<GfVec4d>>());
    return _FloatSamples(samples, instances, 4,
                         realFirst ? std::vector<int>{1, 2, 3, 0} : std::vector<int>{});
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

// Of arrays whose lengths change, the one at the frame or before it alone: it cannot be told which
// instance is which. True where there were more.
bool _KeepOne(HdTrapezeSamples<VtValue>* samples) {
    auto const length = [](VtValue const& value) { return value.GetArraySize(); };
    auto const& values = samples->values;
    if (std::all_of(values.begin(), values.end(),
                    [&](VtValue const& value) { return length(value) == length(values[0]); })) {
        return false;
    }
    size_t i = samples->times.size() - 1;
    while (i > 0 && samples->times[i] > 0.0) {
        --i;
    }
    *samples = {{samples->times[i]}, {samples->values[i]}};
    return true;
}

bool _IsBuiltin(TfToken const& name) {
    TfTokenVector const& names = HdInstancer::GetBuiltinPrimvarNames();
    return std::find(names.begin(), names.end(), name) != names.end() ||
           name == HdTokens->velocities || name == HdTokens->accelerations ||
           name == _tokens->angularVelocities;
}

} // namespace

bool HdTrapezeInstancer::_Less::operator()(VtIntArray const& a, VtIntArray const& b) const {
    if (a.IsIdentical(b)) {
        return false;
    }
    return std::lexicographical_compare(a.cbegin(), a.cend(), b.cbegin(), b.cend());
}

void HdTrapezeInstancer::Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
                              HdDirtyBits* dirtyBits) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    SdfPath const& id = GetId();
    HdDirtyBits const bits = *dirtyBits;
    bool const created = !_created;
    if (created) {
        _created = true;
        param.AddInstancer(id, this);
    }
    SdfPath const before = GetParentId();
    _UpdateInstancer(delegate, dirtyBits);
    SdfPath const& parent = GetParentId();
    if (before != parent) {
        if (HdTrapezeInstancer* instancer = param.FindInstancer(before)) {
            instancer->RemovePart(id);
        }
        for (auto const& [instances, group] : _groups) {
            param.Edit(trz_prim_set_instancer(param.Session(), group.id, 0, 0), id);
        }
    }
    if (!parent.IsEmpty() && (created || HdChangeTracker::IsInstanceIndexDirty(bits, id) ||
                              HdChangeTracker::IsInstancerDirty(bits, id))) {
        // Parents are synced after their children.
        auto* const instancer =
            static_cast<HdTrapezeInstancer*>(delegate->GetRenderIndex().GetInstancer(parent));
        if (instancer) {
            instancer->SetInstancerPart(id, this, delegate->GetInstanceIndices(parent, id));
        }
    }
    GfInterval const shutter = param.Shutter();
    if (created || HdChangeTracker::IsTransformDirty(bits, id)) {
        _transform = HdTrapezeSampleInstancerTransform(delegate, id, shutter);
        for (auto& [instances, group] : _groups) {
            group.hasTransform = false;
        }
    }
    if (created || (bits & HdChangeTracker::DirtyPrimvar)) {
        std::set<TfToken> const wanted = param.WantedPrimvars();
        _primvars.clear();
        _motion = HdTrapezeMotion(id, delegate);
        for (auto const& primvar : delegate->GetPrimvarDescriptors(id, HdInterpolationInstance)) {
            if (_IsBuiltin(primvar.name) || HdTrapezePrimvars::IsNeeded(primvar.name) ||
                wanted.count(primvar.name)) {
                _primvars[primvar.name] = {
                    HdTrapezeSamplePrimvar(delegate, id, primvar.name, shutter), primvar.role,
                    HdTrapezePrimvars::ElementSize(primvar)};
            }
        }
        bool changes = false;
        for (auto& [name, primvar] : _primvars) {
            changes |= _KeepOne(&primvar.samples);
        }
        if (changes && !_primvars.count(HdTokens->velocities)) {
            param.WarnOnce(id,
                           "the number of instances changes around the shutter; they do not move");
        }
        auto const matrices = _primvars.find(HdInstancerTokens->instanceTransforms);
        if (matrices != _primvars.end()) {
            bool const evaluated = _AddMotion(delegate, id, shutter, &matrices->second.samples);
            bool const straight = _AddFrame(delegate, id, &matrices->second.samples);
            _matricesTurn = !evaluated && !straight;
        }
        _CheckLengths(param);
        for (auto& [instances, group] : _groups) {
            group.hasValues = false;
        }
    }
    if (created || (bits & HdChangeTracker::DirtyVisibility)) {
        _visible = delegate->GetVisible(id);
        for (auto& [instances, group] : _groups) {
            group.hasTransform = false;
        }
    }
    *dirtyBits &= ~HdChangeTracker::AllSceneDirtyBits;
}

// Of values that are more than there are instances it cannot be told whose they are: hosts before
// 26.08 do not say it where an instance has several.
void HdTrapezeInstancer::_CheckLengths(HdTrapezeRenderParam& param) {
    size_t instances = 0;
    for (TfToken const& name :
         {HdInstancerTokens->instanceTranslations, HdInstancerTokens->instanceTransforms}) {
        auto const found = _primvars.find(name);
        if (found != _primvars.end() && !found->second.samples.values.empty()) {
            instances = std::max(instances, found->second.samples.values[0].GetArraySize());
        }
    }
    for (auto& [name, primvar] : _primvars) {
        auto& samples = primvar.samples;
        size_t const values = samples.values.empty() ? 0 : samples.values[0].GetArraySize();
        size_t const most = instances * std::max(primvar.elementSize, 1);
        if (most > 0 && values > most && !_IsBuiltin(name)) {
            param.WarnOnce(GetId(), TfStringPrintf("primvar %s has %zu values where its instancer "
                                                   "has %zu instances; it is ignored",
                                                   name.GetText(), values, instances));
            samples = {};
        }
    }
}

void HdTrapezeInstancer::Finalize(HdRenderParam* renderParam) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    SdfPath const& id = GetId();
    param.RemoveInstancer(id);
    if (HdTrapezeInstancer* parent = param.FindInstancer(GetParentId())) {
        parent->RemovePart(id);
    }
    for (auto const& [instances, group] : _groups) {
        param.Edit(trz_prim_remove(param.Session(), group.id), id);
    }
    _groups.clear();
    HdInstancer::Finalize(renderParam);
}

void HdTrapezeInstancer::SetPrimPart(SdfPath const& id, trz_id prim, VtIntArray const& instances) {
    std::lock_guard<std::mutex> lock(_mutex);
    _parts[id] = {*_lists.insert(instances).first, prim, nullptr};
    _partsChanged = true;
}

void HdTrapezeInstancer::SetInstancerPart(SdfPath const& id, HdTrapezeInstancer* child,
                                          VtIntArray const& instances) {
    std::lock_guard<std::mutex> lock(_mutex);
    _parts[id] = {*_lists.insert(instances).first, 0, child};
    _partsChanged = true;
}

void HdTrapezeInstancer::RemovePart(SdfPath const& id) {
    std::lock_guard<std::mutex> lock(_mutex);
    auto const found = _parts.find(id);
    if (found == _parts.end()) {
        return;
    }
    _Part const& part = found->second;
    if (part.child) {
        for (auto const& [instances, group] : part.child->_groups) {
            _links.erase(group.id);
        }
    }
    _links.erase(part.prim);
    _parts.erase(found);
    _partsChanged = true;
}

bool HdTrapezeInstancer::CommitGroups(HdTrapezeRenderParam& param) {
    SdfPath const& id = GetId();
    bool const changed = _partsChanged;
    if (changed) {
        _partsChanged = false;
        std::map<VtIntArray, _Group, _Less> groups;
        for (auto const& [path, part] : _parts) {
            groups[part.instances];
        }
        for (auto& [instances, group] : _groups) {
            auto const found = groups.find(instances);
            if (found != groups.end()) {
                found->second = group;
            } else {
                param.Edit(trz_prim_remove(param.Session(), group.id), id);
            }
        }
        _groups = std::move(groups);
        _lists.clear();
        for (auto const& [instances, group] : _groups) {
            _lists.insert(instances);
        }
    }
    for (auto& [instances, group] : _groups) {
        if (group.id == 0 &&
            !param.Edit(trz_instancer_create(param.Session(), id.GetText(), &group.id), id)) {
            continue;
        }
        if (!group.hasTransform) {
            group.hasTransform = true;
            trz_transform_samples const level = _transform.Level();
            param.Edit(
                trz_prim_set_transform(param.Session(), group.id, &level, _transform.LevelCount()),
                id);
            param.Edit(trz_prim_set_visible(param.Session(), group.id, _visible), id);
        }
        if (group.motion != _motion) {
            group.motion = _motion;
            param.Edit(trz_prim_set_motion(param.Session(), group.id, _motion.blurScale,
                                           _motion.sampleCount),
                       id);
        }
        if (!group.hasValues) {
            group.hasValues = true;
            _SetValues(group.id, instances, param);
        }
    }
    return changed;
}

void HdTrapezeInstancer::_SetValues(trz_id group, VtIntArray const& instances,
                                    HdTrapezeRenderParam& param) {
    SdfPath const& id = GetId();
    auto const get = [&](TfToken const& name) -> HdTrapezeSamples<VtValue> {
        auto const found = _primvars.find(name);
        return found == _primvars.end() ? HdTrapezeSamples<VtValue>() : found->second.samples;
    };
    _FloatSamples const positions(get(HdInstancerTokens->instanceTranslations), instances, 3);
    _FloatSamples const orientations =
        _Rotations(get(HdInstancerTokens->instanceRotations), instances);
    _FloatSamples const scales(get(HdInstancerTokens->instanceScales), instances, 3);
    _FloatSamples const velocities(get(HdTokens->velocities), instances, 3);
    _FloatSamples const accelerations(get(HdTokens->accelerations), instances, 3);
    _FloatSamples const turns(get(_tokens->angularVelocities), instances, 3);
    HdTrapezeSelection const matrices(get(HdInstancerTokens->instanceTransforms), instances, 16);
    std::vector<double const*> matrixValues;
    for (void const* values : matrices.values) {
        matrixValues.push_back(static_cast<double const*>(values));
    }
    trz_instancer desc = {};
    desc.struct_size = sizeof(desc);
    desc.instance_count = instances.size();
    desc.prototype_count = 1;
    desc.positions = positions.View();
    desc.orientations = orientations.View();
    desc.scales = scales.View();
    desc.velocities = velocities.View();
    desc.accelerations = accelerations.View();
    desc.angular_velocities = turns.View();
    if (matrices.type == TRZ_NUMBERS_FLOAT64) {
        desc.matrices = {matrices.times.data(), matrices.times.size(), matrixValues.data(),
                         matrices.counts.data()};
        desc.matrices_turn = _matricesTurn;
    }
    if (!velocities.times.empty() || !accelerations.times.empty() || !turns.times.empty()) {
        desc.time_codes_per_second = param.TimeCodesPerSecond();
    }
    param.Edit(trz_instancer_set(param.Session(), group, &desc), id);
    for (auto const& [name, primvar] : _primvars) {
        if (_IsBuiltin(name)) {
            continue;
        }
        HdTrapezeSelection const values(primvar.samples, instances, 0, primvar.elementSize);
        trz_primvar var = {};
        var.struct_size = sizeof(var);
        var.interpolation = TRZ_INTERPOLATION_VERTEX;
        var.type = values.type;
        var.role = primvar.role == HdPrimvarRoleTokens->color ? TRZ_ROLE_COLOR : TRZ_ROLE_NONE;
        var.width = values.width;
        var.element_size = primvar.elementSize;
        var.unauthored_index = -1;
        var.times = values.times.data();
        var.sample_count = values.times.size();
        var.values = values.values.data();
        var.value_counts = values.counts.data();
        param.Edit(trz_prim_set_primvar(param.Session(), group, name.GetText(),
                                        values.times.empty() ? nullptr : &var),
                   id);
    }
}

void HdTrapezeInstancer::_Link(trz_id part, trz_id group, HdTrapezeRenderParam& param) {
    trz_id& now = _links[part];
    if (now != group) {
        now = group;
        param.Edit(trz_prim_set_instancer(param.Session(), part, group, 0), GetId());
    }
}

void HdTrapezeInstancer::CommitParts(HdTrapezeRenderParam& param) {
    for (auto const& [path, part] : _parts) {
        trz_id const group = _groups[part.instances].id;
        if (part.prim) {
            _Link(part.prim, group, param);
        } else {
            for (auto const& [instances, inner] : part.child->_groups) {
                _Link(inner.id, group, param);
            }
        }
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
