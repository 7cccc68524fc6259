#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/log.hpp>

namespace sidestep::recorded_frames {

/// The items of a recording that its source hands out: from `first_frame` on every `stride`-th, at
/// most `max_frames`, all where that is 0. Fails with kConfig where none is left, in the name of
/// `what` they are, e.g. "frames". [any]; allocates.
template <class Item, class Options>
[[nodiscard]] Result<std::vector<Item>> chosen_frames(std::vector<Item> all, const Options& options,
                                                      const std::string& what,
                                                      const std::string& where) {
  std::vector<Item> chosen;
  const auto stride = static_cast<std::size_t>(options.stride);
  const auto limit =
      options.max_frames > 0 ? static_cast<std::size_t>(options.max_frames) : all.size();
  for (auto i = static_cast<std::size_t>(options.first_frame);
       i < all.size() && chosen.size() < limit; i += stride) {
    chosen.push_back(std::move(all[i]));
  }
  if (chosen.empty()) {
    return fail(ErrorCode::kConfig,
                "first_frame is " + std::to_string(options.first_frame) + ", but there are only " +
                    std::to_string(all.size()) + " " + what,
                where);
  }
  return chosen;
}

/// What is done with a line: its words, and `file:line` for messages.
using HandleWords =
    std::function<Result<void>(const std::vector<std::string>& words, const std::string& where)>;

/// Hands over each line that is more than a comment (from # on) and white space, until one fails.
/// Fails with that, or with kNotFound. [any]; allocates.
[[nodiscard]] Result<void> for_each_line(const std::filesystem::path& file,
                                         const HandleWords& handle);

/// Counts what becomes of the frames of a recording, for the log: told once, at its end or when the
/// source goes. One thread.
class FrameTally {
 public:
  /// Of `total` frames of `recording`. `log` outlives it.
  FrameTally(Log& log, std::string recording, std::size_t total)
      : log_(log), recording_(std::move(recording)), total_(total) {}
  ~FrameTally();
  FrameTally(const FrameTally&) = delete;
  FrameTally& operator=(const FrameTally&) = delete;

  void count_frame(bool is_usable) { ++(is_usable ? handed_out_ : unusable_); }
  /// Something else that was left out of frames, e.g. "points are not finite".
  void count_left_out(const std::string& what, std::size_t count) { left_out_[what] += count; }

  /// Says nothing where no frame was asked for, or all was said.
  void tell();

 private:
  Log& log_;
  std::string recording_;
  std::size_t total_;
  std::size_t handed_out_ = 0;
  std::size_t unusable_ = 0;
  std::map<std::string, std::size_t> left_out_;
};

}  // namespace sidestep::recorded_frames
