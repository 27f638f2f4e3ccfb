#include "arcs.h"

#include "hdtrapeze.h"
#include "schema.h"

#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/tokens.h"
#include "pxr/imaging/hd/xformSchema.h"

#include <algorithm>

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
    std::vector<double> start = {shutter.GetMin()};
    for (double time : samples->times) {
        if (start.front() < time && time < shutter.GetMax()) {
            start.push_back(time);
        }
    }
    start.push_back(shutter.GetMax());
    auto const evaluate = [](void* source, double time, double* matrix) {
        auto const value =
            static_cast<HdMatrixDataSource*>(source)->GetTypedValue(static_cast<float>(time));
        std::copy_n(value.data(), 16, matrix);
    };
    size_t count = std::max<size_t>(64, start.size());
    std::vector<double> times(count);
    std::vector<GfMatrix4d> values(count);
    if (trz_path_sample(start.data(), start.size(), evaluate, source.get(), times.data(),
                        values[0].data(), count, &count) != TRZ_OK ||
        count == 0) {
        return false;
    }
    times.resize(count);
    values.resize(count);
    samples->times = std::move(times);
    samples->values = std::move(values);
    return true;
}

PXR_NAMESPACE_CLOSE_SCOPE
