#pragma once

#include <vector>

#include "view_message.hpp"

namespace sidestep {

/// Whom a feed's messages go to: the pages that are connected, a recording. Called by the feed's
/// thread alone.
class ViewSink {
 public:
  virtual ~ViewSink() = default;

  struct Demand {
    bool any = false;        ///< Somebody reads; else nothing needs to be made.
    bool newcomers = false;  ///< Somebody has not been greeted yet.
    std::vector<SliceRequest> slices;
  };
  [[nodiscard]] virtual Demand demand() = 0;

  /// What there is, in order, for those who were not greeted yet and get all later messages, too.
  virtual void greet(const std::vector<ViewMessage>& messages) = 0;
  /// For all who were greeted.
  virtual void publish(const ViewMessage& message) = 0;
  /// For those of them who want this slice.
  virtual void publish_slice(const SliceRequest& request, const ViewMessage& message) = 0;
};

}  // namespace sidestep
