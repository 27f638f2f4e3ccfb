#include "words.h"

#include "renderParam.h"

#include "hdtrapeze.h"

#include "pxr/base/tf/diagnostic.h"
#include "pxr/imaging/pxOsd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

uint32_t HdTrapezeWord(std::map<TfToken, uint32_t> const& words, TfToken const& word,
                       uint32_t fallback, SdfPath const& id, HdTrapezeRenderParam& param) {
    auto const found = words.find(word);
    if (found != words.end()) {
        return found->second;
    }
    if (!word.IsEmpty()) {
        param.WarnOnce(id, "unknown word " + word.GetString() + "; USD's fallback is used");
    }
    return fallback;
}

uint32_t HdTrapezeOrientation(TfToken const& word) {
    return word == PxOsdOpenSubdivTokens->leftHanded ? TRZ_ORIENTATION_LEFT_HANDED
                                                     : TRZ_ORIENTATION_RIGHT_HANDED;
}

PXR_NAMESPACE_CLOSE_SCOPE
