#include "numbers.h"
#include "samples.h"
#include "schema.h"
#include "shapes.h"

#include <map>

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
    std::vector<_Size> sizes;
};

// By the name of the schema: that of the type, without the number of its version.
_Kind const& _KindOf(std::string const& schema) {
    static std::map<std::string, _Kind> const kinds = {
        {"cube", {TRZ_IMPLICIT_CUBE, {{"size", 2.0}}}},
        {"sphere", {TRZ_IMPLICIT_SPHERE, {{"radius", 1.0}}}},
        {"plane", {TRZ_IMPLICIT_PLANE, {{"width", 2.0}, {"length", 2.0}}}},
        {"cone", {TRZ_IMPLICIT_CONE, {{"height", 2.0}, {"radius", 1.0}}}},
        {"cylinder",
         {TRZ_IMPLICIT_CYLINDER,
          {{"height", 2.0}, {"radiusBottom", 1.0, "radius"}, {"radiusTop", 1.0, "radius"}}}},
        {"capsule",
         {TRZ_IMPLICIT_CAPSULE,
          {{"height", 1.0}, {"radiusBottom", 0.5, "radius"}, {"radiusTop", 0.5, "radius"}}}},
    };
    return kinds.at(schema);
}

} // namespace

void HdTrapezeSendImplicit(HdTrapezeSyncing const& prim) {
    std::string const name = prim.type.GetString().substr(0, prim.type.GetString().find('_'));
    _Kind const& kind = _KindOf(name);
    HdTrapezeSchema const schema(prim.delegate, prim.id, HdDataSourceLocator(TfToken(name)));
    std::vector<HdTrapezeSamples<double>> tracks;
    for (_Size const& size : kind.sizes) {
        auto& samples = tracks.emplace_back(schema.Sample(TfToken(size.name), prim.shutter));
        if (samples.values.empty() && size.uniform) {
            samples = schema.Sample(TfToken(size.uniform), prim.shutter);
        }
    }
    std::vector<double> times = HdTrapezeTimes(tracks);
    if (times.empty()) {
        times = {0.0};
    }
    std::vector<double> sizes(3 * times.size());
    for (size_t i = 0; i < times.size(); ++i) {
        for (size_t k = 0; k < tracks.size(); ++k) {
            sizes[3 * i + k] = HdTrapezeAt(tracks[k], times[i], kind.sizes[k].fallback);
        }
    }
    auto desc = HdTrapezeStruct<trz_implicit>();
    desc.kind = kind.kind;
    desc.axis = prim.Word("axis", schema.Get(TfToken("axis"), TfToken()));
    desc.orientation = TRZ_ORIENTATION_RIGHT_HANDED; // Hydra's schemas have no other
    desc.times = times.data();
    desc.sizes = sizes.data();
    desc.sample_count = times.size();
    prim.Edit(trz_implicit_set, &desc);
    // Delegates are asked for meshes' sides alone.
    prim.Edit(trz_prim_set_double_sided,
              schema.Get(TfToken("doubleSided"), kind.kind == TRZ_IMPLICIT_PLANE));
}

PXR_NAMESPACE_CLOSE_SCOPE
