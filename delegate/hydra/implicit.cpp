#include "implicit.h"

#include "schema.h"
#include "words.h"

#include <set>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// One of the numbers that a kind's size is made of, under its name, or the one that it has where
// the lower and the upper end are alike.
struct _Size {
    TfToken name;
    TfToken uniform;
    double fallback;
};

struct _Kind {
    uint32_t kind;
    TfToken schema;
    std::vector<_Size> sizes;
};

std::map<TfToken, _Kind> const& _Kinds() {
    static std::map<TfToken, _Kind> const kinds = [] {
        auto const size = [](char const* name, double fallback, char const* uniform = "") {
            return _Size{TfToken(name), TfToken(uniform), fallback};
        };
        std::vector<_Size> const cube = {size("size", 2.0)};
        std::vector<_Size> const sphere = {size("radius", 1.0)};
        std::vector<_Size> const plane = {size("width", 2.0), size("length", 2.0)};
        std::vector<_Size> const cone = {size("height", 2.0), size("radius", 1.0)};
        auto const ends = [&](double height, double radius) {
            return std::vector<_Size>{size("height", height),
                                      size("radiusBottom", radius, "radius"),
                                      size("radiusTop", radius, "radius")};
        };
        std::map<TfToken, _Kind> kinds;
        auto const add = [&](char const* type, char const* schema, uint32_t kind,
                             std::vector<_Size> const& sizes) {
            kinds[TfToken(type)] = {kind, TfToken(schema), sizes};
        };
        add("cube", "cube", TRZ_IMPLICIT_CUBE, cube);
        add("sphere", "sphere", TRZ_IMPLICIT_SPHERE, sphere);
        add("plane", "plane", TRZ_IMPLICIT_PLANE, plane);
        add("cone", "cone", TRZ_IMPLICIT_CONE, cone);
        for (char const* type : {"cylinder", "cylinder_1"}) {
            add(type, "cylinder", TRZ_IMPLICIT_CYLINDER, ends(2.0, 1.0));
        }
        for (char const* type : {"capsule", "capsule_1"}) {
            add(type, "capsule", TRZ_IMPLICIT_CAPSULE, ends(1.0, 0.5));
        }
        return kinds;
    }();
    return kinds;
}

uint32_t _Axis(TfToken const& word, SdfPath const& id, HdTrapezeRenderParam& param) {
    static std::map<TfToken, uint32_t> const words = {
        {TfToken("X"), TRZ_AXIS_X}, {TfToken("Y"), TRZ_AXIS_Y}, {TfToken("Z"), TRZ_AXIS_Z}};
    return HdTrapezeWord(words, word, TRZ_AXIS_Z, id, param);
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
    HdTrapezeSchema const schema(delegate, id, HdDataSourceLocator(kind.schema));
    GfInterval const shutter = prim.Shutter(param);
    std::vector<HdTrapezeSamples<double>> tracks;
    std::set<double> times; // of those that change, if any
    for (_Size const& size : kind.sizes) {
        auto samples = schema.Sample(size.name, shutter);
        if (samples.values.empty() && !size.uniform.IsEmpty()) {
            samples = schema.Sample(size.uniform, shutter);
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
    desc.axis = _Axis(schema.Get(TfToken("axis"), TfToken()), id, param);
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
