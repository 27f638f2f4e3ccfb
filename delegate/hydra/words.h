#ifndef HDTRAPEZE_WORDS_H
#define HDTRAPEZE_WORDS_H

#include "pxr/base/tf/token.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <cstdint>
#include <map>

PXR_NAMESPACE_OPEN_SCOPE

class HdTrapezeRenderParam;

/// The constant that a word stands for; the fallback where the word is empty. What is unknown gives
/// a warning.
uint32_t HdTrapezeWord(std::map<TfToken, uint32_t> const& words, TfToken const& word,
                       uint32_t fallback, SdfPath const& id, HdTrapezeRenderParam& param);

/// TRZ_ORIENTATION_*.
uint32_t HdTrapezeOrientation(TfToken const& word);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
