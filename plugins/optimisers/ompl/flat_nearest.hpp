#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/datastructures/NearestNeighbors.h>
#include <ompl/util/Exception.h>

#include <sidestep/core/lanes.hpp>

namespace sidestep::ompl_optimiser {

/// Points of a vector space, looked through in lanes: up to some ten thousand of them, the nearest
/// is found sooner so than by a tree that asks for distances one by one.
class FlatPoints {
 public:
  explicit FlatPoints(std::size_t dof) : dof_(dof) {}

  void clear() noexcept;
  void add(const double* point);
  /// Puts the last in its place.
  void remove(std::size_t number);
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// The number of the nearest, in the order of add(); of several, the first of its lane. There
  /// must be one.
  [[nodiscard]] std::size_t nearest(const double* point) const noexcept;

 private:
  [[nodiscard]] double& at(std::size_t number, std::size_t joint) noexcept {
    return blocks_[(number / kLanes * dof_ + joint) * kLanes + number % kLanes];
  }

  std::size_t dof_;
  std::size_t size_ = 0;
  std::vector<double>
      blocks_;  ///< kLanes points each, joint by joint; infinite where there is none.
};

/// The same as OMPL wants it, of motions with a `state`.
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
  FlatPoints points_;
};

}  // namespace sidestep::ompl_optimiser
