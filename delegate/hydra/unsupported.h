#ifndef HDTRAPEZE_UNSUPPORTED_H
#define HDTRAPEZE_UNSUPPORTED_H

#include "rprim.h"

#include "pxr/imaging/hd/tokens.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// A prim of a type that is not rendered. Hosts drop types that a delegate does not name without
/// a word; this one says so.
class HdTrapezeUnsupported final : public HdTrapezeRprim<HdTrapezePlainRprim> {
public:
    HdTrapezeUnsupported(SdfPath const& id, TfToken const& type, HdTrapezeRenderParam& param)
        : HdTrapezeRprim(id, nullptr, HdTrapezePrim::Points::No) {
        param.WarnOnce(id,
                       "prims of type " + type.GetString() + " are not supported; it is left out");
    }

    static TfTokenVector const& Types() {
        static TfTokenVector const types = {HdPrimTypeTokens->volume, HdPrimTypeTokens->tetMesh};
        return types;
    }
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
