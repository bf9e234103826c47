"""A fit that holds given values: a model without error, or with a chosen one."""

from collections.abc import Mapping

import numpy as np

from helisim.ident import Fit, FittedParameter, FrequencyResponse, Structure
from helisim.ident.evaluate import response


def held(structure: Structure, values: Mapping[str, float]) -> Fit:
    """Return the model of a structure with these values, as a fit that has seen no record."""
    fixed = structure.with_fixed(dict(values))
    frequency = np.geomspace(0.5, 30.0, 20)
    pairs = [f"{output}/{input_}" for output in fixed.outputs for input_ in fixed.inputs]
    return Fit(
        structure=fixed,
        parameters={
            one.name: FittedParameter(one, values[one.name], 0.0, 0.0, 0.0, at_bound=False)
            for one in fixed.parameters
        },
        correlation=np.zeros((0, 0)),
        costs=dict.fromkeys(pairs, 0.0),
        bands=dict.fromkeys(pairs, (0.5, 30.0)),
        dropped=(),
        converged=True,
        searches_agreeing=2,
        data=FrequencyResponse.exact(
            frequency,
            response(fixed, values, frequency),
            inputs=fixed.inputs,
            outputs=fixed.outputs,
        ),
    )
