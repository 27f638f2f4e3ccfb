#include "words.h"

#include "renderParam.h"

#include "hdtrapeze.h"

PXR_NAMESPACE_OPEN_SCOPE

uint32_t HdTrapezeWord(char const* attribute, TfToken const& word, SdfPath const& id,
                       HdTrapezeRenderParam& param) {
    uint32_t constant = 0;
    if (trz_word(attribute, word.GetText(), &constant) == TRZ_ERROR_NOT_FOUND) {
        param.WarnOnce(id, "unknown word " + word.GetString() + "; USD's fallback is used");
    }
    return constant;
}

PXR_NAMESPACE_CLOSE_SCOPE
