#pragma once

// Part of view_server.cpp, which alone includes it.

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <sidestep/core/low_priority.hpp>

#include "page_desk.hpp"

namespace sidestep::serving {

/// The thread in which a desk answers. Each client has one request under way at most, so that the
/// queue is as long as there are clients.
class DeskWorker {
 public:
  /// Nothing: the page is to be dropped. Called by the worker's thread.
  using Answered = std::function<void(std::optional<std::vector<ViewMessage>>)>;

  explicit DeskWorker(PageDesk& desk)
      : desk_(desk), thread_([this](const std::stop_token& stop) { work(stop); }) {}

  /// Without a request, for the greeting. [any]
  void ask(std::optional<std::string> request, Answered answered) {
    {
      const std::lock_guard lock(mutex_);
      queue_.push_back({std::move(request), std::move(answered)});
    }
    wake_.notify_one();
  }

 private:
  struct Task {
    std::optional<std::string> request;
    Answered answered;
  };

  void work(const std::stop_token& stop) {
    lower_thread_priority();
    for (;;) {
      Task task;
      {
        std::unique_lock lock(mutex_);
        if (!wake_.wait(lock, stop, [&] { return !queue_.empty(); })) return;
        if (stop.stop_requested()) return;
        task = std::move(queue_.front());
        queue_.pop_front();
      }
      task.answered(answer(task, stop));
    }
  }

  std::optional<std::vector<ViewMessage>> answer(const Task& task, const std::stop_token& stop) {
    try {
      if (!task.request) return desk_.greeting();
      const auto message = desk_.answer(*task.request, stop);
      if (message) return std::vector<ViewMessage>{*message};
    } catch (const std::exception&) {
      return std::nullopt;  // Costs this page its connection, and nobody else anything.
    }
    return std::nullopt;
  }

  PageDesk& desk_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::deque<Task> queue_;
  std::jthread thread_;
};

}  // namespace sidestep::serving
