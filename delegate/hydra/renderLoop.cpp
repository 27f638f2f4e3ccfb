#include "renderLoop.h"

PXR_NAMESPACE_OPEN_SCOPE

HdTrapezeRenderLoop::HdTrapezeRenderLoop(trz_session* session)
    : _session(session), _thread([this] { _Run(); }) {}

HdTrapezeRenderLoop::~HdTrapezeRenderLoop() {
    {
        std::lock_guard<std::mutex> lock(_mutex);
        _quit = true;
        _changed.notify_all();
    }
    trz_render_cancel(_session);
    _thread.join();
}

void HdTrapezeRenderLoop::Start(std::vector<Job> jobs) {
    bool running;
    {
        std::lock_guard<std::mutex> lock(_mutex);
        running = _busy;
        ++_wanted;
        _jobs = std::move(jobs);
        _changed.notify_all();
    }
    if (running) {
        trz_render_interrupt(_session);
    }
}

void HdTrapezeRenderLoop::Stop(bool wait) {
    {
        std::lock_guard<std::mutex> lock(_mutex);
        _stopped = true;
        _changed.notify_all();
    }
    trz_render_interrupt(_session);
    if (wait) {
        std::unique_lock<std::mutex> lock(_mutex);
        _changed.wait(lock, [this] { return !_busy; });
    }
}

void HdTrapezeRenderLoop::Resume() {
    std::lock_guard<std::mutex> lock(_mutex);
    if (_stopped) {
        _stopped = false;
        if (_finished < _wanted) {
            ++_wanted;
        }
        _changed.notify_all();
    }
}

bool HdTrapezeRenderLoop::IsStopped() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return _stopped && !_busy;
}

bool HdTrapezeRenderLoop::IsConverged() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return _stopped ? !_busy : _finished == _wanted;
}

uint64_t HdTrapezeRenderLoop::Generation() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return _readable;
}

uint64_t HdTrapezeRenderLoop::Starts() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return _wanted;
}

// With the mutex held.
bool HdTrapezeRenderLoop::_IsGivenUp(uint64_t mine) const {
    return _quit || _stopped || _wanted != mine;
}

// With the mutex held, but while it works. False where the other jobs are not to follow.
bool HdTrapezeRenderLoop::_RunJob(Job const& job, uint64_t mine, bool isLast,
                                  std::unique_lock<std::mutex>& lock) {
    trz_progress progress = {};
    progress.struct_size = sizeof(progress);
    std::string failure;
    // A cancel that was meant for the render before may come late: then it is made again.
    do {
        _readable = isLast ? _readable : 0;
        lock.unlock();
        job.prepare();
        trz_result result = trz_render_start(_session);
        failure = result == TRZ_OK ? "" : trz_last_error();
        lock.lock();
        if (result == TRZ_OK && isLast) {
            _readable = mine;
        }
        // The next Start or Stop ends the wait by cancelling.
        uint32_t ended = result != TRZ_OK;
        while (!ended && !_IsGivenUp(mine)) {
            lock.unlock();
            if (trz_render_wait(_session, 0.05, &ended) != TRZ_OK) {
                failure = trz_last_error();
                ended = 1;
            }
            lock.lock();
        }
        if (_IsGivenUp(mine)) {
            lock.unlock();
            trz_render_cancel(_session);
            lock.lock();
            return false;
        }
        trz_render_progress(_session, &progress);
    } while (progress.state == TRZ_STATE_CANCELLED);
    lock.unlock();
    job.finish(failure);
    lock.lock();
    return true;
}

void HdTrapezeRenderLoop::_Run() {
    std::unique_lock<std::mutex> lock(_mutex);
    while (true) {
        _changed.wait(lock, [this] { return _quit || (!_stopped && _started != _wanted); });
        if (_quit) {
            return;
        }
        uint64_t const mine = _wanted;
        _started = mine;
        _busy = true;
        std::vector<Job> const jobs = _jobs;
        bool isWhole = true;
        for (size_t i = 0; i < jobs.size() && isWhole; ++i) {
            isWhole = _RunJob(jobs[i], mine, i + 1 == jobs.size(), lock);
        }
        _busy = false;
        // Resume makes up for what was given up.
        _finished = isWhole ? mine : _finished;
        _changed.notify_all();
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
