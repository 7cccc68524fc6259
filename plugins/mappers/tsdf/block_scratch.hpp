#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace sidestep::tsdf {

/// Values of one frame by block, for the blocks that the frame touches; a value before its
/// first use is `empty`. Keeps its memory from frame to frame.
template <class Value>
class BlockScratch {
 public:
  BlockScratch(std::size_t block_count, std::size_t values_per_block, Value empty)
      : slots_(block_count, kNone), per_block_(values_per_block), empty_(empty) {}

  /// The values of a block, until the next call.
  [[nodiscard]] Value* block(std::int32_t block) {
    std::int32_t& slot = slots_[static_cast<std::size_t>(block)];
    if (slot == kNone) {
      slot = static_cast<std::int32_t>(touched_.size());
      touched_.push_back(block);
      const std::size_t needed = touched_.size() * per_block_;
      if (values_.size() < needed) values_.resize(std::max(needed, values_.size() * 2));
      std::fill_n(values_.data() + needed - per_block_, per_block_, empty_);
    }
    return values_.data() + static_cast<std::size_t>(slot) * per_block_;
  }

  void clear() noexcept {
    for (const std::int32_t block : touched_) slots_[static_cast<std::size_t>(block)] = kNone;
    touched_.clear();
  }

 private:
  static constexpr std::int32_t kNone = -1;
  std::vector<std::int32_t> slots_;
  std::vector<std::int32_t> touched_;
  std::vector<Value> values_;
  std::size_t per_block_;
  Value empty_;
};

}  // namespace sidestep::tsdf
