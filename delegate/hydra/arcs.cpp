#include "arcs.h"

#include "hdtrapeze.h"
#include "schema.h"

#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/tokens.h"
#include "pxr/imaging/hd/xformSchema.h"

#include <array>
#include <map>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

HdMatrixDataSourceHandle _Find(HdSceneDelegate* delegate, SdfPath const& id) {
    HdContainerDataSourceHandle const prim = HdTrapezeFindSource(delegate->GetRenderIndex(), id);
    if (!prim || prim->Get(HdSceneIndexEmulationTokens->sceneDelegate)) {
        return nullptr;
    }
    return HdXformSchema::GetFromParent(prim).GetMatrix();
}

} // namespace

bool HdTrapezeAddArcs(HdSceneDelegate* delegate, SdfPath const& id, GfInterval const& shutter,
                      HdTrapezeSamples<GfMatrix4d>* samples) {
    if (samples->times.size() < 2 || shutter.GetSize() == 0.0) {
        return false;
    }
    HdMatrixDataSourceHandle const source = _Find(delegate, id);
    if (!source) {
        return false;
    }
    auto const at = [&](double time) { return source->GetTypedValue(static_cast<float>(time)); };
    std::vector<double> times = {shutter.GetMin()};
    for (double time : samples->times) {
        if (times.front() < time && time < shutter.GetMax()) {
            times.push_back(time);
        }
    }
    times.push_back(shutter.GetMax());
    size_t const start = times.size();
    std::vector<GfMatrix4d> values(start);
    std::transform(times.begin(), times.end(), values.begin(), at);
    for (size_t i = 1; i < start; ++i) {
        // A value that is held next to one of its ends is no path, but samples of one.
        double const quarter = 0.25 * (times[i] - times[i - 1]);
        if (values[i - 1] != values[i] &&
            (at(times[i - 1] + quarter) == values[i - 1] || at(times[i] - quarter) == values[i])) {
            return false;
        }
    }
    std::array<double, 64> missing;
    size_t count = 0;
    std::vector<uint8_t> keep;
    do {
        std::vector<double const*> arrays;
        for (GfMatrix4d const& value : values) {
            arrays.push_back(value.data());
        }
        trz_path path = {};
        path.struct_size = sizeof(path);
        path.of = TRZ_PATH_MATRICES;
        path.times = times.data();
        path.start_count = start;
        path.known_count = times.size();
        path.values = arrays.data();
        path.element_count = 1;
        keep.resize(times.size());
        if (trz_path_next(&path, missing.data(), missing.size(), &count, keep.data()) != TRZ_OK) {
            return false;
        }
        for (size_t i = 0; i < count; ++i) {
            times.push_back(missing[i]);
            values.push_back(at(missing[i]));
        }
    } while (count > 0);
    std::map<double, GfMatrix4d> kept;
    for (size_t i = 0; i < times.size(); ++i) {
        if (keep[i]) {
            kept.emplace(times[i], values[i]);
        }
    }
    *samples = {};
    for (auto const& [time, value] : kept) {
        samples->times.push_back(time);
        samples->values.push_back(value);
    }
    return true;
}

PXR_NAMESPACE_CLOSE_SCOPE
