#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/mapping/mapper.hpp>
#include <sidestep/measures/point_survey.hpp>
#include <sidestep/sensing/source.hpp>

namespace sidestep {

/// A depth image kept for the report: at most `kMaxWidth_px` wide, every n-th pixel.
struct DepthPicture {
  static constexpr int kMaxWidth_px = 320;
  std::int64_t frame_sequence = 0;
  int rows = 0;
  int columns = 0;
  std::vector<float> depth_m;
};

/// Passes on at most `limit` frames (0: all) of another source, and keeps some depth images,
/// spread evenly over them. [mapping]
class FrameTap final : public Source {
 public:
  /// `count`: frames that the source has; nothing where it cannot be known.
  FrameTap(Source& source, std::optional<std::int64_t> count, std::int64_t limit, int pictures);

  [[nodiscard]] Result<std::optional<Frame>> next(const Deadline& deadline) override;
  [[nodiscard]] std::optional<std::int64_t> frame_count() const override;

  /// Whether to keep a copy of the last frame that was passed on.
  void keep_last(bool keeps) noexcept { keeps_last_ = keeps; }
  /// Null before the first one that was kept.
  [[nodiscard]] const std::shared_ptr<const Frame>& last() const noexcept { return last_; }

  /// Surveys the points of what is passed on from now on, in the mapper's grid.
  void survey(const Mapper& mapper, PointSurvey survey) {
    mapper_ = &mapper;
    survey_ = survey;
  }
  [[nodiscard]] const PointSurvey& survey() const noexcept { return survey_; }

  [[nodiscard]] const std::vector<DepthPicture>& pictures() const noexcept { return pictures_; }

  /// "mapped the first 300 of 1000 frames" where the limit ended the stream; else empty.
  [[nodiscard]] std::string left_out() const;

 private:
  void keep(const Frame& frame);

  Source& source_;
  std::optional<std::int64_t> count_;
  std::int64_t limit_;
  int wanted_;
  std::int64_t passed_ = 0;  ///< Frames asked for, usable or not.
  bool is_cut_ = false;      ///< The limit ended the stream.
  std::int64_t stride_ = 1;  ///< Every stride_-th frame is kept.
  std::vector<DepthPicture> pictures_;
  bool keeps_last_ = false;
  std::shared_ptr<const Frame> last_;
  const Mapper* mapper_ = nullptr;
  PointSurvey survey_;
};

}  // namespace sidestep
