"""CCSDS navigation messages (OEM, AEM) and tables of states: read, interpolated and written."""
