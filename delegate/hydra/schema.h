#ifndef HDTRAPEZE_SCHEMA_H
#define HDTRAPEZE_SCHEMA_H

#include "samples.h"

#include "pxr/imaging/hd/dataSource.h"
#include "pxr/imaging/hd/dataSourceLocator.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// What the host's scene index has of a prim; null where there is none.
HdContainerDataSourceHandle HdTrapezeFindSource(HdRenderIndex const& index, SdfPath const& id);

/// What a prim has under the name of one of Hydra's schemas: fields that scene delegates have no
/// function for. They come from the host's scene index, else from the delegate by their names.
class HdTrapezeSchema final {
public:
    HdTrapezeSchema(HdSceneDelegate* delegate, SdfPath const& id, HdDataSourceLocator const& where);

    /// The same of scene indices alone.
    HdTrapezeSchema(HdRenderIndex const& index, SdfPath const& id,
                    HdDataSourceLocator const& where);

    /// A field's value at the frame; empty where there is none.
    VtValue Get(TfToken const& field) const;

    /// At the frame, as that type; `fallback` where there is none, or one that is no such thing.
    template <class T> T Get(TfToken const& field, T const& fallback) const {
        VtValue const value = VtValue::Cast<T>(Get(field));
        return value.IsHolding<T>() ? value.UncheckedGet<T>() : fallback;
    }

    /// A number that may change; no samples where it is not there.
    HdTrapezeSamples<double> Sample(TfToken const& field, GfInterval const& shutter) const;

private:
    HdSampledDataSourceHandle _Find(TfToken const& field) const;

    HdSceneDelegate* _delegate = nullptr;
    SdfPath _id;
    HdContainerDataSourceHandle _fields;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
