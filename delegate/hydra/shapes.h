#ifndef HDTRAPEZE_SHAPES_H
#define HDTRAPEZE_SHAPES_H

#include "syncing.h"

#include "pxr/base/vt/array.h"
#include "pxr/pxr.h"

#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// A kind of geometry prims: a type of Hydra's, and what these prims alone have.
struct HdTrapezeShape {
    TfToken type;
    /// Null where such prims are not rendered.
    trz_result (*create)(trz_session*, char const* path, trz_id* out) = nullptr;
    /// Whether it has points, with velocities and accelerations.
    bool hasPoints = false;
    /// Sends what is the kind's own, where one of these bits is dirty. Null where points and
    /// primvars are all there is.
    void (*send)(HdTrapezeSyncing const& prim) = nullptr;
    HdDirtyBits bits = 0;
    /// By the topology, which of the points each vertex is; null where they are in order.
    VtIntArray (*indices)(HdSceneDelegate*, SdfPath const&) = nullptr;
};

/// All kinds that hosts may have, also those that are not rendered: hosts drop types that a
/// delegate does not name without a word.
std::vector<HdTrapezeShape> const& HdTrapezeShapes();

/// A polygon mesh or subdivision surface; always rendered as the latter's limit.
void HdTrapezeSendMesh(HdTrapezeSyncing const& prim);

/// Curves: ribbons or tubes as wide as the primvar widths says.
void HdTrapezeSendBasisCurves(HdTrapezeSyncing const& prim);
VtIntArray HdTrapezeCurveIndices(HdSceneDelegate* delegate, SdfPath const& id);

/// What curves without normals are rendered as, as the primvar trapeze:curves says: TRZ_CURVES_*.
uint32_t HdTrapezeCurveForm(HdTrapezeSyncing const& prim);

/// NURBS, as hosts with scene indices hand them on.
void HdTrapezeSendNurbsCurves(HdTrapezeSyncing const& prim);
void HdTrapezeSendNurbsPatch(HdTrapezeSyncing const& prim);

/// A cube, sphere, cylinder, cone, capsule or plane, as hosts with scene indices hand them on.
void HdTrapezeSendImplicit(HdTrapezeSyncing const& prim);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
