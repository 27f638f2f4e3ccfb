#include "renderLoop.h"

#include "pxr/base/tf/diagnostic.h"

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

void HdTrapezeRenderLoop::Start() {
    bool running;
    {
        std::lock_guard<std::mutex> lock(_mutex);
        running = !_IsIdle();
        ++_wanted;
        _changed.notify_all();
    }
    if (running) {
        trz_render_cancel(_session);
    }
}

void HdTrapezeRenderLoop::SetOnFinished(std::function<void()> onFinished) {
    std::lock_guard<std::mutex> lock(_mutex);
    _onFinished = std::move(onFinished);
}

void HdTrapezeRenderLoop::Stop(bool wait) {
    {
        std::lock_guard<std::mutex> lock(_mutex);
        _stopped = true;
        _changed.notify_all();
    }
    trz_render_cancel(_session);
    if (wait) {
        std::unique_lock<std::mutex> lock(_mutex);
        _changed.wait(lock, [this] { return _IsIdle(); });
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
    return _stopped && _IsIdle();
}

bool HdTrapezeRenderLoop::IsConverged() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return _stopped ? _IsIdle() : _finished == _wanted;
}

uint64_t HdTrapezeRenderLoop::Generation() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return _readable;
}

// With the mutex held.
bool HdTrapezeRenderLoop::_IsIdle() const { return !_starting && _readable <= _finished; }

void HdTrapezeRenderLoop::_Run() {
    std::unique_lock<std::mutex> lock(_mutex);
    while (true) {
        _changed.wait(lock, [this] { return _quit || (!_stopped && _started != _wanted); });
        if (_quit) {
            return;
        }
        uint64_t const mine = _wanted;
        _started = mine;
        _starting = true;
        lock.unlock();
        trz_result const result = trz_render_start(_session);
        if (result != TRZ_OK && result != TRZ_ERROR_CANCELLED) {
            TF_RUNTIME_ERROR("Trapeze: %s (%s)", trz_last_error(), trz_result_name(result));
        }
        lock.lock();
        _starting = false;
        if (result == TRZ_OK) {
            _readable = mine;
            // The next Start or Stop ends the wait by cancelling.
            while (!_quit && !_stopped && _wanted == mine) {
                lock.unlock();
                uint32_t finished = 0;
                trz_result const waited = trz_render_wait(_session, 0.05, &finished);
                lock.lock();
                if (finished || waited != TRZ_OK) {
                    break;
                }
            }
            if (_quit || _stopped || _wanted != mine) {
                lock.unlock();
                trz_render_cancel(_session);
                lock.lock();
            } else if (_onFinished) {
                auto const onFinished = _onFinished;
                lock.unlock();
                onFinished();
                lock.lock();
            }
        } else if (result == TRZ_ERROR_CANCELLED && !_stopped && _wanted == mine && !_quit) {
            // Cancelled by a call that came early: try again.
            _started = 0;
            continue;
        }
        _finished = mine;
        _changed.notify_all();
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
