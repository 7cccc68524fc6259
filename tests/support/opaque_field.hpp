#pragma once

#include <memory>
#include <utility>

#include <sidestep/field/distance_field.hpp>

namespace sidestep::testing_support {

/// Another field under a type that nobody knows: it has to be asked point by point.
class OpaqueField final : public DistanceField {
 public:
  explicit OpaqueField(std::shared_ptr<const DistanceField> field)
      : DistanceField(field->info()), field_(std::move(field)) {}
  void query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
             std::span<Eigen::Vector3d> gradients,
             std::span<FieldStatus> statuses) const noexcept override {
    field_->query(points_m, distances_m, gradients, statuses);
  }

 private:
  std::shared_ptr<const DistanceField> field_;
};

}  // namespace sidestep::testing_support
