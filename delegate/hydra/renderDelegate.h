#ifndef HDTRAPEZE_RENDER_DELEGATE_H
#define HDTRAPEZE_RENDER_DELEGATE_H

#include "renderParam.h"
#include "settings.h"

#include "pxr/imaging/hd/renderDelegate.h"
#include "pxr/pxr.h"

#include <memory>

PXR_NAMESPACE_OPEN_SCOPE

/// Makes prims, buffers and passes for Hydra, and holds the renderer's session and settings.
/// Delegates of one process share nothing.
class HdTrapezeRenderDelegate final : public HdRenderDelegate {
public:
    explicit HdTrapezeRenderDelegate(HdRenderSettingsMap const& settings);

    HdTrapezeRenderParam& Param() { return *_param; }

    /// Whether an AOV of that name is rendered.
    static bool IsAov(TfToken const& name);

    /// Hydra's types of lights.
    static TfTokenVector const& Lights();

    /// What the host has set, beside defaults.
    HdTrapezeSettingsLayer const& Settings() const { return _settings; }

    /// False where the host wants whole images, and the files of products.
    bool IsInteractive() const;

    HdRenderParam* GetRenderParam() const override { return _param.get(); }
    TfTokenVector const& GetSupportedRprimTypes() const override;
    TfTokenVector const& GetSupportedSprimTypes() const override;
    TfTokenVector const& GetSupportedBprimTypes() const override;
    HdResourceRegistrySharedPtr GetResourceRegistry() const override { return _registry; }

    HdRenderSettingDescriptorList GetRenderSettingDescriptors() const override;
    void SetRenderSetting(TfToken const& key, VtValue const& value) override;
    VtDictionary GetRenderStats() const override;
    TfTokenVector GetRenderSettingsNamespaces() const override;
    HdCommandDescriptors GetCommandDescriptors() const override;
    bool InvokeCommand(TfToken const& command, HdCommandArgs const& args) override;

    bool IsPauseSupported() const override { return true; }
    bool Pause() override;
    bool Resume() override;
    bool IsStopSupported() const override { return true; }
    bool IsStopped() const override;
    bool Stop(bool blocking = true) override;
    bool Restart() override;

    HdRenderPassSharedPtr CreateRenderPass(HdRenderIndex* index,
                                           HdRprimCollection const& collection) override;
    HdInstancer* CreateInstancer(HdSceneDelegate* delegate, SdfPath const& id) override;
    void DestroyInstancer(HdInstancer* instancer) override;
    HdRprim* CreateRprim(TfToken const& type, SdfPath const& id) override;
    void DestroyRprim(HdRprim* prim) override;
    HdSprim* CreateSprim(TfToken const& type, SdfPath const& id) override;
    HdSprim* CreateFallbackSprim(TfToken const& type) override;
    void DestroySprim(HdSprim* prim) override;
    HdBprim* CreateBprim(TfToken const& type, SdfPath const& id) override;
    HdBprim* CreateFallbackBprim(TfToken const& type) override;
    void DestroyBprim(HdBprim* prim) override;

    void CommitResources(HdChangeTracker* tracker) override;
    TfToken GetMaterialBindingPurpose() const override;
    TfTokenVector GetMaterialRenderContexts() const override;
    HdAovDescriptor GetDefaultAovDescriptor(TfToken const& name) const override;

private:
    std::unique_ptr<HdTrapezeRenderParam> _param;
    HdTrapezeSettingsLayer _settings{HdTrapezeSettingsLayer::Owner::Host};
    HdResourceRegistrySharedPtr _registry;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
