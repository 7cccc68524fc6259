#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep::incremental {

/// What a mapper made of a sequence of frames, replayed without the work of integrating them.
class RecordedMap final : public Mapper, public OccupancyView {
 public:
  explicit RecordedMap(const GridSpec& grid) : grid_(grid) { rewind(); }

  /// Appends the state of a mapper with the same grid after `update`.
  void record(const MapUpdate& update, const OccupancyView& view) {
    State state{update, {}};
    const VoxelBits occupied = view.occupied();
    const VoxelBits known = view.known();
    for (std::size_t w = 0; w < occupied_.size(); ++w) {
      if (occupied.words[w] == occupied_[w] && known.words[w] == known_[w]) continue;
      state.changes.push_back({w, occupied.words[w], known.words[w]});
    }
    states_.push_back(std::move(state));
    step();
  }

  void rewind() {
    const std::size_t words = static_cast<std::size_t>(words_per_row()) *
                              static_cast<std::size_t>(grid_.size_vox.y()) *
                              static_cast<std::size_t>(grid_.size_vox.z());
    occupied_.assign(words, 0);
    known_.assign(words, 0);
    next_ = 0;
  }
  [[nodiscard]] bool at_end() const { return next_ == states_.size(); }

  const MapUpdate& step() {
    const State& state = states_[next_++];
    for (const Change& change : state.changes) {
      occupied_[change.word] = change.occupied;
      known_[change.word] = change.known;
    }
    return state.update;
  }

  Result<MapUpdate> integrate(const Frame&) override { return step(); }
  [[nodiscard]] const GridSpec& grid() const noexcept override { return grid_; }
  [[nodiscard]] const GridSpec& occupancy_grid() const noexcept override { return grid_; }
  [[nodiscard]] VoxelBits occupied() const noexcept override {
    return {occupied_, words_per_row()};
  }
  [[nodiscard]] VoxelBits known() const noexcept override { return {known_, words_per_row()}; }

 private:
  struct Change {
    std::size_t word;
    std::uint64_t occupied, known;
  };
  struct State {
    MapUpdate update;
    std::vector<Change> changes;
  };
  [[nodiscard]] int words_per_row() const noexcept { return (grid_.size_vox.x() + 63) / 64; }

  GridSpec grid_;
  std::vector<std::uint64_t> occupied_, known_;
  std::vector<State> states_;
  std::size_t next_ = 0;
};

}  // namespace sidestep::incremental
