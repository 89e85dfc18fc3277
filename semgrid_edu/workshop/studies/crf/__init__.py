"""The CRF measured: error against time, coupling, parameters searched and learnt."""
