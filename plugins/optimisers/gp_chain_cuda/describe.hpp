#pragma once

#include <memory>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/field/dense_field.hpp>
#include <sidestep/planning/problem.hpp>

#include "chain_batch.hpp"

namespace sidestep::gp_chain_cuda {

/// A problem as a batch takes it.
struct DescribedProblem {
  ChainDescription chain;
  std::vector<double> own_numbers;          ///< Of its targets.
  std::shared_ptr<const DenseField> field;  ///< Null where no term looks into one.
  FieldOnDevice field_shape;                ///< Of the field, without pointers.
};

/// Takes a valid problem apart. Fails with kInvalidArgument, naming what it is, where a robot, a
/// field or a cost is of a kind that kernels do not know, or larger than they have room for.
[[nodiscard]] Result<DescribedProblem> describe(const Problem& problem);

/// Samples of the prior of a problem, multiplied with `spread`, without their normal numbers.
[[nodiscard]] SamplesOnHost describe_samples(const Problem& problem, double spread);

}  // namespace sidestep::gp_chain_cuda
