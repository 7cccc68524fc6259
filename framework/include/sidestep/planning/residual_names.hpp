#pragma once

#include <string>

#include <sidestep/core/export.hpp>

namespace sidestep {

/// What a residual of a cost measures, in words.
struct ResidualName {
  std::string quantity;   ///< E.g. "position of hand"; its residuals are the components of one.
  std::string component;  ///< E.g. "along z"; empty where a component says nothing by itself.
  std::string target;     ///< What it is off, e.g. "its target".
  std::string unit;       ///< Of the quantity.
  double sigma = 1.0;     ///< Of the quantity, in its unit, per unit of the residual.
};

/// Optional interface of a StateCost: names of its residuals. Explanations (explain.hpp) and
/// reports of a missed goal (goal.hpp) use them instead of numbers of rows.
class SIDESTEP_EXPORT NamesResiduals {
 public:
  virtual ~NamesResiduals() = default;

  /// Of one of the cost's residuals, from 0. [any]; allocates.
  [[nodiscard]] virtual ResidualName residual_name(int residual) const = 0;
};

}  // namespace sidestep
