#pragma once

#include <sidestep/planning/problem.hpp>
