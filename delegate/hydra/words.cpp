#include "words.h"

#include "hdtrapeze.h"

#include "pxr/base/tf/diagnostic.h"
#include "pxr/imaging/pxOsd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

uint32_t HdTrapezeWord(std::map<TfToken, uint32_t> const& words, TfToken const& word,
                       uint32_t fallback, SdfPath const& id) {
    auto const found = words.find(word);
    if (found != words.end()) {
        return found->second;
    }
    if (!word.IsEmpty()) {
        TF_WARN("Trapeze <%s>: unknown word %s; USD's fallback is used", id.GetText(),
                word.GetText());
    }
    return fallback;
}

uint32_t HdTrapezeOrientation(TfToken const& word) {
    return word == PxOsdOpenSubdivTokens->leftHanded ? TRZ_ORIENTATION_LEFT_HANDED
                                                     : TRZ_ORIENTATION_RIGHT_HANDED;
}

PXR_NAMESPACE_CLOSE_SCOPE
