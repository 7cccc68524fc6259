#pragma once

#include <cstdint>

#include <sidestep/core/export.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep {

/// Holds a mapper to what its interface promises, as far as that costs next to nothing: fields and
/// trackers work by its updates, and read its bits, without asking. [mapping]
class SIDESTEP_EXPORT MapCheck {
 public:
  /// Of a mapper as it is now, which outlives the check.
  explicit MapCheck(const Mapper& mapper);

  /// After each frame that it has taken. Fails with kPlugin, saying what does not hold.
  [[nodiscard]] Result<void> check(const Frame& frame, const MapUpdate& update);

 private:
  const Mapper& mapper_;
  const OccupancyView* occupancy_;  ///< Null where it offers none.
  GridSpec grid_;
  std::int64_t sequence_ = 0;  ///< Of the last update; 0 before the first.
};

}  // namespace sidestep
