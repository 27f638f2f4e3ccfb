#ifndef HDTRAPEZE_INSTANCER_H
#define HDTRAPEZE_INSTANCER_H

#include "primvars.h"

#include "pxr/base/vt/array.h"
#include "pxr/imaging/hd/instancer.h"
#include "pxr/pxr.h"

#include <map>
#include <mutex>

PXR_NAMESPACE_OPEN_SCOPE

/// An instancer.
///
/// Hydra tells prototypes apart by lists of instance numbers. Parts of a prototype have the same
/// list, so each distinct one is a prototype of the session's instancer. instanceId is a place in
/// the list, as pickers expect.
class HdTrapezeInstancer final : public HdInstancer {
public:
    HdTrapezeInstancer(HdSceneDelegate* delegate, SdfPath const& id) : HdInstancer(delegate, id) {}

    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
              HdDirtyBits* dirtyBits) override;
    void Finalize(HdRenderParam* renderParam) override;

    /// Whether a primvar of an instancer says where its instances are.
    static bool IsPlace(TfToken const& name);

    /// Makes a prim, or another instancer, part of the prototype that these instances show. From
    /// any thread.
    void SetPart(SdfPath const& id, trz_id part, VtIntArray const& instances);

    void RemovePart(SdfPath const& id);

    /// Hands on lists and values, and links parts with their prototypes. Not during Sync.
    void Commit(HdTrapezeRenderParam& param);

private:
    struct _Part {
        VtIntArray instances;
        trz_id id = 0;
        /// The prototype that the session knows it to be part of.
        size_t prototype = SIZE_MAX;
    };

    void _Sync(HdSceneDelegate* delegate, HdTrapezeRenderParam& param, HdDirtyBits bits);
    void _SyncPlaces(HdTrapezeSyncing const& instancer);
    void _SendPlaces(HdTrapezeRenderParam& param);

    trz_id _id = 0;
    /// It is not drawn, since the host could not tell what it is.
    bool _lost = false;
    /// What says where instances are.
    std::map<TfToken, HdTrapezeSamples<VtValue>> _places;
    /// How instanceTransforms go between samples; see turns of HdTrapezeTransform.
    uint32_t _matricesTurn = 0;
    HdTrapezeMotion _motion;
    HdTrapezePrimvars _primvars;

    std::mutex _mutex;
    std::map<SdfPath, _Part> _parts;
    bool _partsChanged = true;
    bool _placesChanged = true;
    /// The instances of each prototype.
    std::vector<VtIntArray> _lists;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
