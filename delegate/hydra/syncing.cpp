#include "syncing.h"

#include "pxr/imaging/hd/tokens.h"

#include <algorithm>

PXR_NAMESPACE_OPEN_SCOPE

uint32_t HdTrapezeSyncing::Word(char const* attribute, TfToken const& word) const {
    uint32_t constant = 0;
    if (trz_word(attribute, word.GetText(), &constant) == TRZ_ERROR_NOT_FOUND) {
        param.WarnOnce(id, trz_last_error());
    }
    return constant;
}

void HdTrapezeSyncing::SendTransform(HdTrapezeTransform const& samples) const {
    trz_transform_samples const level = {
        samples.times.data(), samples.values.empty() ? nullptr : samples.values[0].GetArray(),
        samples.values.size(), samples.turns};
    Edit(trz_prim_set_transform, &level, samples.values.empty() ? 0 : 1);
}

void HdTrapezeSyncing::SendMotion(HdTrapezeMotion* known) const {
    // Some hosts have USD's fallback, 3, where nothing is authored; as many as needed are better.
    auto const constants = delegate->GetPrimvarDescriptors(id, HdInterpolationConstant);
    auto const isCount = [](auto const& p) { return p.name == HdTokens->nonlinearSampleCount; };
    bool const listed = std::any_of(constants.begin(), constants.end(), isCount);
    int const given = delegate->Get(id, HdTokens->nonlinearSampleCount).GetWithDefault<int>(0);
    uint32_t const count = given <= 0 || (given == 3 && !listed) ? 0 : given;
    double const scale =
        VtValue::Cast<double>(delegate->Get(id, HdTokens->blurScale)).GetWithDefault<double>(1.0);
    if (scale != known->blurScale || count != known->sampleCount) {
        *known = {scale, count};
        Edit(trz_prim_set_motion, scale, count);
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
