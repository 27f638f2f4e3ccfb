#ifndef HDTRAPEZE_PRODUCTS_H
#define HDTRAPEZE_PRODUCTS_H

#include "hdtrapeze.h"

#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/renderSettings.h"
#include "pxr/pxr.h"

#include <deque>
#include <set>
#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdTrapezeCamera;

/// Render products as the C ABI takes them. They point into the prim that they are of.
class HdTrapezeProducts final {
public:
    /// `settings` are all but the image's shape. Null camera where there is none at its path.
    void Add(HdRenderSettings::RenderProduct const& product, HdTrapezeCamera const* camera,
             trz_settings const& settings, trz_session* session);

    std::vector<trz_product const*> const& All() const { return _all; }

    /// Primvars that their vars show.
    std::set<TfToken> const& Primvars() const { return _primvars; }

private:
    char const* _Keep(std::string const& text) { return _texts.emplace_back(text).c_str(); }
    std::vector<trz_render_var> _Vars(HdRenderSettings::RenderProduct const& product,
                                      trz_session* session);

    // Places of these stay when more are added.
    std::deque<trz_product> _products;
    std::deque<trz_settings> _settings;
    std::deque<std::vector<trz_render_var>> _vars;
    std::deque<std::string> _texts;
    std::vector<trz_product const*> _all;
    std::set<TfToken> _primvars;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
