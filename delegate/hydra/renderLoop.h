#ifndef HDTRAPEZE_RENDER_LOOP_H
#define HDTRAPEZE_RENDER_LOOP_H

#include "hdtrapeze.h"

#include "pxr/pxr.h"

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// Commits edits and renders on a thread of its own, so that no call of the host waits for either.
/// Functions may be called from any thread.
class HdTrapezeRenderLoop final {
public:
    explicit HdTrapezeRenderLoop(trz_session* session);

    /// Cancels what runs and waits for it.
    ~HdTrapezeRenderLoop();

    /// One of several renders. Both functions are called on the loop's thread: what queues the view
    /// that is rendered, and what follows when all samples were taken, or what failed.
    struct Job {
        std::function<void()> prepare;
        std::function<void(std::string const& failure)> finish;
    };

    /// Makes the renders one after the other, each from the first sample; what runs is given up.
    /// Only the last can be read.
    void Start(std::vector<Job> jobs);

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

    /// How often renders were started.
    uint64_t Starts() const;

private:
    void _Run();
    bool _RunJob(Job const& job, uint64_t mine, bool isLast, std::unique_lock<std::mutex>& lock);
    bool _IsGivenUp(uint64_t mine) const;

    trz_session* const _session;
    mutable std::mutex _mutex;
    std::condition_variable _changed;
    std::vector<Job> _jobs;
    uint64_t _wanted = 0;
    uint64_t _started = 0;
    uint64_t _readable = 0;
    uint64_t _finished = 0;
    bool _busy = false;
    bool _stopped = false;
    bool _quit = false;
    std::thread _thread;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
