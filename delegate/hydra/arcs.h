#ifndef HDTRAPEZE_ARCS_H
#define HDTRAPEZE_ARCS_H

#include "samples.h"

#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// Samples for the shutter of a transform that turns: the host's scene index evaluates a prim at
/// any time, so there are as many samples as keep the lines between them to its path, as the
/// renderer says. False, with samples as they were, where the host knows no more than these: prims
/// of scene delegates of the older kind, and data sources that hold samples.
bool HdTrapezeAddArcs(HdSceneDelegate* delegate, SdfPath const& id, GfInterval const& shutter,
                      HdTrapezeSamples<GfMatrix4d>* samples);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
