#include "schema.h"

#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/sceneIndex.h"

PXR_NAMESPACE_OPEN_SCOPE

HdContainerDataSourceHandle HdTrapezeFindSource(HdRenderIndex const& index, SdfPath const& id) {
    HdSceneIndexBaseRefPtr const scene = index.GetTerminalSceneIndex();
    return scene ? scene->GetPrim(id).dataSource : nullptr;
}

HdTrapezeSchema::HdTrapezeSchema(HdSceneDelegate* delegate, SdfPath const& id,
                                 HdDataSourceLocator const& where)
    : HdTrapezeSchema(delegate->GetRenderIndex(), id, where) {
    _delegate = delegate;
}

HdTrapezeSchema::HdTrapezeSchema(HdRenderIndex const& index, SdfPath const& id,
                                 HdDataSourceLocator const& where)
    : _id(id) {
    if (auto const prim = HdTrapezeFindSource(index, id)) {
        _fields = HdContainerDataSource::Cast(HdContainerDataSource::Get(prim, where));
    }
}

HdSampledDataSourceHandle HdTrapezeSchema::_Find(TfToken const& field) const {
    return _fields ? HdSampledDataSource::Cast(_fields->Get(field)) : nullptr;
}

VtValue HdTrapezeSchema::Get(TfToken const& field) const {
    if (HdSampledDataSourceHandle const source = _Find(field)) {
        return source->GetValue(0.0f);
    }
    return _fields || !_delegate ? VtValue() : _delegate->Get(_id, field);
}

HdTrapezeSamples<double> HdTrapezeSchema::Sample(TfToken const& field,
                                                 GfInterval const& shutter) const {
    HdSampledDataSourceHandle const source = _Find(field);
    std::vector<HdSampledDataSource::Time> times;
    if (!source ||
        !source->GetContributingSampleTimesForInterval(
            static_cast<float>(shutter.GetMin()), static_cast<float>(shutter.GetMax()), &times)) {
        times = {0.0f};
    }
    HdTrapezeSamples<VtValue> samples;
    for (HdSampledDataSource::Time time : times) {
        samples.times.push_back(time);
        samples.values.push_back(source ? source->GetValue(time) : Get(field));
    }
    return HdTrapezeCast<double>(samples);
}

PXR_NAMESPACE_CLOSE_SCOPE
