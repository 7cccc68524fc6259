#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

namespace sidestep {

/// A table of shared, immutable blocks. Entries lie in pages that copies of the table share:
/// publishing a table costs one pointer an entry and otherwise time proportional to its changes.
template <class Block>
class BlockTable {
 public:
  using Entry = std::shared_ptr<const Block>;
  static constexpr std::size_t kPage = 32;

  BlockTable() = default;
  /// `size` entries, all null.
  explicit BlockTable(std::size_t size)
      : blocks_(size, nullptr),
        pages_((size + kPage - 1) / kPage, std::make_shared<Page>()),
        is_own_(pages_.size(), 0) {}
  BlockTable(const std::vector<Entry>& entries) : BlockTable(entries.size()) {
    for (std::size_t i = 0; i < entries.size(); ++i) set(i, entries[i]);
  }

  [[nodiscard]] std::size_t size() const noexcept { return blocks_.size(); }
  [[nodiscard]] const Entry& operator[](std::size_t i) const noexcept {
    return (*pages_[i / kPage])[i % kPage];
  }
  /// The block of an entry that is not null, by one step less.
  [[nodiscard]] const Block& block(std::size_t i) const noexcept { return *blocks_[i]; }

  /// Replaces an entry. Threads may replace entries of different pages at once.
  void set(std::size_t i, Entry entry) {
    const std::size_t page = i / kPage;
    if (is_own_[page] == 0) {
      pages_[page] = std::make_shared<Page>(*pages_[page]);
      is_own_[page] = 1;
    }
    blocks_[i] = entry.get();
    (*pages_[page])[i % kPage] = std::move(entry);
  }

  /// A copy, which later calls of set() do not change.
  [[nodiscard]] BlockTable share() {
    is_own_.assign(is_own_.size(), 0);
    return *this;
  }

  friend bool operator==(const BlockTable& a, const BlockTable& b) noexcept {
    return a.blocks_ == b.blocks_;
  }

 private:
  using Page = std::array<Entry, kPage>;

  std::vector<const Block*> blocks_;
  std::vector<std::shared_ptr<Page>> pages_;  ///< Own the blocks.
  std::vector<std::uint8_t> is_own_;          ///< Whether no copy shares a page.
};

}  // namespace sidestep
