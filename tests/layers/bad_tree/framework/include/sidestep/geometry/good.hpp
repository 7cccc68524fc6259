#include <sidestep/core/error.hpp>
