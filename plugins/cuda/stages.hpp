#pragma once

#include <array>
#include <cstddef>

namespace sidestep::cuda {

/// The parts of an update as the paper's breakdown has them (Finean 2021, Sec. VI).
enum class Stage { kUpload, kIntegrate, kTransform, kDownload };
inline constexpr std::size_t kStages = 4;

/// How long each took in the newest update, in milliseconds; 0 for those that it had none of.
struct StageTimes {
  std::array<double, kStages> ms{};

  [[nodiscard]] double of(Stage stage) const noexcept {
    return ms[static_cast<std::size_t>(stage)];
  }
};

}  // namespace sidestep::cuda
