#ifndef HDTRAPEZE_WORDS_H
#define HDTRAPEZE_WORDS_H

#include "pxr/base/tf/token.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <cstdint>

PXR_NAMESPACE_OPEN_SCOPE

class HdTrapezeRenderParam;

/// The constant that a word stands for as the value of an attribute, USD's fallback where the word
/// is empty. What is unknown gives a warning.
uint32_t HdTrapezeWord(char const* attribute, TfToken const& word, SdfPath const& id,
                       HdTrapezeRenderParam& param);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
