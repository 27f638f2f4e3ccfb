#ifndef HDTRAPEZE_POINTS_H
#define HDTRAPEZE_POINTS_H

#include "rprim.h"

#include "pxr/imaging/hd/points.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// Points: spheres as wide as the primvar widths says.
class HdTrapezePoints final : public HdTrapezeRprim<HdPoints> {
public:
    explicit HdTrapezePoints(SdfPath const& id)
        : HdTrapezeRprim(id, trz_spheres_create, HdTrapezePrim::Points::Yes) {}
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
