#include "implicit.h"

#include "schema.h"

#include <set>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// One of the numbers that a kind's size is made of, under its name, or the one that it has where
// the lower and the upper end are alike.
struct _Size {
    char const* name;
    double fallback;
    char const* uniform = nullptr;
};

struct _Kind {
    uint32_t kind;
    char const* schema;
    std::vector<_Size> sizes;
};

std::map<TfToken, _Kind> const& _Kinds() {
    static auto const kinds = [] {
        _Kind const cylinder = {
            TRZ_IMPLICIT_CYLINDER,
            "cylinder",
            {{"height", 2.0}, {"radiusBottom", 1.0, "radius"}, {"radiusTop", 1.0, "radius"}}};
        _Kind const capsule = {
            TRZ_IMPLICIT_CAPSULE,
            "capsule",
            {{"height", 1.0}, {"radiusBottom", 0.5, "radius"}, {"radiusTop", 0.5, "radius"}}};
        return std::map<TfToken, _Kind>{
            {TfToken("cube"), {TRZ_IMPLICIT_CUBE, "cube", {{"size", 2.0}}}},
            {TfToken("sphere"), {TRZ_IMPLICIT_SPHERE, "sphere", {{"radius", 1.0}}}},
            {TfToken("plane"), {TRZ_IMPLICIT_PLANE, "plane", {{"width", 2.0}, {"length", 2.0}}}},
            {TfToken("cone"), {TRZ_IMPLICIT_CONE, "cone", {{"height", 2.0}, {"radius", 1.0}}}},
            {TfToken("cylinder"), cylinder},
            {TfToken("cylinder_1"), cylinder},
            {TfToken("capsule"), capsule},
            {TfToken("capsule_1"), capsule},
        };
    }();
    return kinds;
}

} // namespace

TfTokenVector const& HdTrapezeImplicit::Types() {
    static TfTokenVector const types = [] {
        TfTokenVector types;
        for (auto const& [type, kind] : _Kinds()) {
            types.push_back(type);
        }
        return types;
    }();
    return types;
}

void HdTrapezeImplicit::_SyncShape(HdTrapezePrim const& prim, HdSceneDelegate* delegate,
                                   HdTrapezeRenderParam& param, HdDirtyBits bits) {
    SdfPath const& id = GetId();
    if (!(bits & (HdChangeTracker::DirtyPrimvar | HdChangeTracker::DirtyTopology |
                  HdChangeTracker::DirtyPoints | HdChangeTracker::DirtyExtent |
                  HdChangeTracker::DirtyDoubleSided))) {
        return;
    }
    _Kind const& kind = _Kinds().at(_type);
    HdTrapezeSchema const schema(delegate, id, HdDataSourceLocator(TfToken(kind.schema)));
    GfInterval const shutter = prim.Shutter(param);
    std::vector<HdTrapezeSamples<double>> tracks;
    std::set<double> times; // of those that change, if any
    for (_Size const& size : kind.sizes) {
        auto samples = schema.Sample(TfToken(size.name), shutter);
        if (samples.values.empty() && size.uniform) {
            samples = schema.Sample(TfToken(size.uniform), shutter);
        }
        if (samples.times.size() > 1) {
            times.insert(samples.times.begin(), samples.times.end());
        }
        tracks.push_back(std::move(samples));
    }
    if (times.empty()) {
        times = {0.0};
    }
    std::vector<double> const sorted(times.begin(), times.end());
    std::vector<double> sizes(3 * sorted.size());
    for (size_t i = 0; i < sorted.size(); ++i) {
        for (size_t k = 0; k < tracks.size(); ++k) {
            sizes[3 * i + k] = HdTrapezeAt(tracks[k], sorted[i], kind.sizes[k].fallback);
        }
    }
    trz_implicit desc = {};
    desc.struct_size = sizeof(desc);
    desc.kind = kind.kind;
    desc.axis = param.Word("axis", schema.Get(TfToken("axis"), TfToken()), id);
    desc.orientation = TRZ_ORIENTATION_RIGHT_HANDED; // Hydra's schemas have no other
    desc.times = sorted.data();
    desc.sizes = sizes.data();
    desc.sample_count = sorted.size();
    param.Edit(trz_implicit_set(param.Session(), prim.Id(), &desc), id);
    // Delegates are asked for meshes' sides alone.
    bool const sides = schema.Get(TfToken("doubleSided"), kind.kind == TRZ_IMPLICIT_PLANE);
    param.Edit(trz_prim_set_double_sided(param.Session(), prim.Id(), sides), id);
}

PXR_NAMESPACE_CLOSE_SCOPE
