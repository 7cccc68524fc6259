#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/datastructures/NearestNeighbors.h>
#include <ompl/util/Exception.h>

#include "flat_points.hpp"

namespace sidestep::ompl_optimiser {

/// FlatPoints as OMPL wants them, of motions with a `state`.
template <class Motion>
class FlatNearest final : public ::ompl::NearestNeighbors<Motion> {
 public:
  explicit FlatNearest(std::size_t dof) : points_(dof) {}

  [[nodiscard]] bool reportsSortedResults() const override { return true; }
  void clear() override {
    motions_.clear();
    points_.clear();
  }
  void add(const Motion& motion) override {
    motions_.push_back(motion);
    points_.add(values(motion));
  }
  bool remove(const Motion& motion) override {
    const auto found = std::find(motions_.begin(), motions_.end(), motion);
    if (found == motions_.end()) return false;
    points_.remove(static_cast<std::size_t>(found - motions_.begin()));
    *found = motions_.back();
    motions_.pop_back();
    return true;
  }
  Motion nearest(const Motion& motion) const override {
    if (motions_.empty()) throw ::ompl::Exception("No elements found in nearest neighbors");
    return motions_[points_.nearest(values(motion))];
  }
  void nearestK(const Motion& motion, std::size_t k, std::vector<Motion>& found) const override {
    found = motions_;
    const std::size_t kept = std::min(k, found.size());
    std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(kept), found.end(),
                      [&](const Motion& a, const Motion& b) {
                        return this->distFun_(motion, a) < this->distFun_(motion, b);
                      });
    found.resize(kept);
  }
  void nearestR(const Motion& motion, double radius, std::vector<Motion>& found) const override {
    nearestK(motion, motions_.size(), found);
    while (!found.empty() && this->distFun_(motion, found.back()) > radius) found.pop_back();
  }
  [[nodiscard]] std::size_t size() const override { return motions_.size(); }
  void list(std::vector<Motion>& all) const override { all = motions_; }

 private:
  static const double* values(const Motion& motion) {
    return motion->state->template as<::ompl::base::RealVectorStateSpace::StateType>()->values;
  }

  std::vector<Motion> motions_;
  joint_paths::FlatPoints points_;
};

}  // namespace sidestep::ompl_optimiser
