#ifndef HDTRAPEZE_RENDER_LOOP_H
#define HDTRAPEZE_RENDER_LOOP_H

#include "hdtrapeze.h"

#include "pxr/pxr.h"

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>

PXR_NAMESPACE_OPEN_SCOPE

/// Commits edits and renders on a thread of its own, so that no call of the host waits for either.
/// Functions may be called from any thread.
class HdTrapezeRenderLoop final {
public:
    explicit HdTrapezeRenderLoop(trz_session* session);

    /// Cancels what runs and waits for it.
    ~HdTrapezeRenderLoop();

    /// Renders what is queued from the first sample; what runs is given up.
    void Start();

    /// Calls this, on the loop's thread, when a render that was started has taken all its samples.
    void SetOnFinished(std::function<void()> onFinished);

    /// Gives up what runs, and starts nothing until Resume. What was rendered stays readable.
    void Stop(bool wait);

    /// Ends Stop: renders anew where something was given up.
    void Resume();

    bool IsStopped() const;

    /// Whether there is nothing more to come: all samples were taken, or it failed, or it was
    /// stopped.
    bool IsConverged() const;

    /// The number of the render that AOVs can be read of, 0 for none; it grows with each.
    uint64_t Generation() const;

private:
    void _Run();
    bool _IsIdle() const;

    trz_session* const _session;
    mutable std::mutex _mutex;
    std::condition_variable _changed;
    std::function<void()> _onFinished;
    uint64_t _wanted = 0;
    uint64_t _started = 0;
    uint64_t _readable = 0;
    uint64_t _finished = 0;
    bool _starting = false;
    bool _stopped = false;
    bool _quit = false;
    std::thread _thread;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
